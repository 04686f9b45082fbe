"""Speed against accuracy of the built-in cameras in one small chart, of the bench's JSON."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from camkit.report.figure import new_figure, to_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BENCH: Final = Path("docs/results/bench/bench.json")
SIZE_IN: Final = (8.0, 3.6)
NAME_ROOM: Final = 1.15
"""The names of the cameras lie right of their last points."""
FILTER: Final = "wiener"
MARKS: Final = {FILTER: "s", "S": "o", "M": "D"}
NAMES: Final = {FILTER: "filter alone", "S": "network S", "M": "network M"}


def write_front(path: Path, bench: Path = BENCH) -> None:
    """Draw decibels gained over the developed capture against seconds.

    Args:
        path: PNG.
        bench: What `camkit bench --all` wrote.

    Raises:
        OSError: If one cannot be read or the other written.
    """
    record = json.loads(bench.read_text(encoding="utf-8"))
    figure = new_figure(*SIZE_IN)
    axes = figure.subplots()
    for camera, rows in restored_rows(record).items():
        _draw_camera(axes, camera, rows)
    for way, mark in MARKS.items():
        axes.plot([], [], mark, color="0.4", label=NAMES[way])
    axes.set_xlim(0, axes.get_xlim()[1] * NAME_ROOM)
    axes.set_ylim(0, axes.get_ylim()[1] * 1.05)
    axes.set_xlabel(f"seconds for 24 megapixels on a CPU of {record['machine']['cores']} cores")
    axes.set_ylabel("dB gained over\nthe picture as taken")
    axes.legend(loc="lower right")
    axes.grid(alpha=0.3)
    path.write_bytes(to_png(figure))


def restored_rows(record: Mapping[str, Any]) -> dict[str, dict[str, Mapping[str, Any]]]:
    """Return camera -> way (the filter, or a size of the network) -> row, of cameras with both."""
    rows_of_camera: dict[str, dict[str, Mapping[str, Any]]] = {}
    for row in record["rows"]:
        way = row["method"] if row["size"] is None else row["size"]
        if way in MARKS and row["error"] is None and _is_default(row, record):
            rows_of_camera.setdefault(row["bundle"], {})[way] = row
    return {
        camera: rows for camera, rows in rows_of_camera.items() if FILTER in rows and len(rows) > 1
    }


def _is_default(row: Mapping[str, Any], record: Mapping[str, Any]) -> bool:
    """Return whether a row is of exact tiles in fp32 on all threads of the CPU."""
    defaults = {"mode": "exact", "dtype": "fp32", "provider": "cpu"}
    is_plain = all(row.get(name) in (None, value) for name, value in defaults.items())
    return is_plain and row["threads"] == record["machine"]["threads"] and not row["variant"]


def gained_db(row: Mapping[str, Any]) -> float:
    """Return the decibels of a row over the developed capture."""
    return float(row["psnr_db"] - row["input_psnr_db"])


def _draw_camera(axes: "Axes", camera: str, rows: Mapping[str, Mapping[str, Any]]) -> None:
    ways = [way for way in MARKS if way in rows]
    points = [(rows[way]["s_per_24mp"], gained_db(rows[way])) for way in ways]
    (line,) = axes.plot(*zip(*points, strict=True), linewidth=1)
    for way, (seconds, decibels) in zip(ways, points, strict=True):
        axes.plot(seconds, decibels, MARKS[way], color=line.get_color())
    axes.annotate(
        camera,
        points[-1],
        xytext=(9, 4),
        textcoords="offset points",
        color=line.get_color(),
        verticalalignment="center",
    )
