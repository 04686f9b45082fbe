"""The chart of the front of methods: decibels against CPU-seconds a megapixel."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from camkit.report.figure import FIELD_COLORS, Panel, chart, new_figure, to_png, to_svg
from camkit.report.figure import Figure as Drawing

RECORD: Final = Path("docs/results/methods.json")
SIZE_IN: Final = (8.0, 4.2)
COLORS: Final = {
    "classical": "0.45",
    "bank": FIELD_COLORS[1],
    "trained": FIELD_COLORS[0],
    "shipped": FIELD_COLORS[2],
}
KINDS: Final = {
    "classical": "classical",
    "bank": "camkit's Wiener bank",
    "trained": "trained from scratch, {minutes:g} CPU-minutes each",
    "shipped": "camkit's networks as shipped",
}
TICKS_S: Final = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
LETTER_PT: Final = (3.7, 8.0)
"""Width and height of a letter of a name, with a little room."""
OFFSETS_PT: Final = ((7, 3), (7, -9), (-7, 3), (-7, -9), (7, 13), (-7, 13), (7, -19), (-7, -19))
"""Places of a name, the best first; left of its point where the first is below 0."""
POINT_PT: Final = 5.0

Box = tuple[float, float, float, float]
DEVELOPED: Final = "input"
"""The row whose decibels the others gain; it restores nothing, so it is no point."""


def write_front_chart(path: Path, record: Path = RECORD) -> None:
    """Draw a record.

    Args:
        path: PNG or SVG.
        record: What `judge` wrote.

    Raises:
        OSError: If one cannot be read or the other written.
    """
    figure = draw(json.loads(record.read_text(encoding="utf-8")))
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".svg":
        path.write_text(to_svg(figure), encoding="utf-8")
    else:
        path.write_bytes(to_png(figure))


@chart
def draw(record: Mapping[str, Any]) -> Drawing:
    """Return the chart; error bars are those of the paired difference to S."""
    rows = restoring_rows(record)
    figure = new_figure(*SIZE_IN)
    panel = figure.subplots()
    for kind, label in KINDS.items():
        points = [row for row in rows if row["kind"] == kind]
        if points:
            _draw_points(panel, points, COLORS[kind], label.format(minutes=record["minutes"]))
    front = front_of(rows)
    panel.plot(*zip(*front, strict=True), color="0.75", linewidth=1, zorder=0)
    panel.set_xscale("log")
    low, high = panel.get_xlim()
    ticks = [tick for tick in TICKS_S if low < tick < 2 * high]
    panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.set_xticks([], minor=True)
    panel.set_xlim(low, high * 2)
    panel.set_xlabel("CPU-seconds a megapixel, one thread, from developed to restored planes")
    panel.set_ylabel("dB gained over the picture as taken\n(bars: error of the difference to S)")
    panel.legend(loc="best")
    figure.draw_without_rendering()  # its layout decides where points lie
    places_pt = panel.transData.transform([(r["cpu_s_per_mp"], r["gain_db"]) for r in rows])
    places_pt *= 72 / figure.dpi
    titles = [row["title"] for row in rows]
    left_pt = panel.bbox.x0 * 72 / figure.dpi
    offsets = label_offsets(places_pt.tolist(), titles, left_pt)
    for row, offset in zip(rows, offsets, strict=True):
        name = panel.annotate(
            row["title"],
            (row["cpu_s_per_mp"], row["gain_db"]),
            xytext=offset,
            textcoords="offset points",
            horizontalalignment="left" if offset[0] > 0 else "right",
            fontsize=7,
            color=COLORS[row["kind"]],
        )
        name.set_in_layout(False)
    return figure


def restoring_rows(record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the rows that restore, with `gain_db` over the developed capture."""
    (developed_db,) = [r["psnr_db"] for r in record["rows"] if r["name"] == DEVELOPED]
    return [
        {**row, "gain_db": row["psnr_db"] - developed_db}
        for row in record["rows"]
        if row["name"] != DEVELOPED
    ]


def front_of(rows: Sequence[Mapping[str, Any]]) -> list[tuple[float, float]]:
    """Return (seconds, gain) of the rows that no faster row is as good as."""
    front: list[tuple[float, float]] = []
    for row in sorted(rows, key=lambda row: (row["cpu_s_per_mp"], -row["gain_db"])):
        if not front or row["gain_db"] > front[-1][1]:
            front.append((row["cpu_s_per_mp"], row["gain_db"]))
    return front


def label_offsets(
    places_pt: Sequence[Sequence[float]], titles: Sequence[str], left_pt: float
) -> list[tuple[int, int]]:
    """Return (right, up) of every name in points: the first place that meets nothing.

    Args:
        places_pt: (x, y) of every point.
        titles: Its name.
        left_pt: Where the panel begins; its right has room.
    """
    boxes: list[Box] = [
        (x - POINT_PT, y - POINT_PT, x + POINT_PT, y + POINT_PT) for x, y in places_pt
    ]
    boxes.append((-math.inf, -math.inf, left_pt, math.inf))
    offsets = []
    for number, ((x, y), title) in enumerate(zip(places_pt, titles, strict=True)):
        others = [box for i, box in enumerate(boxes) if i != number]
        choices = {offset: _label_box(x, y, offset, title) for offset in OFFSETS_PT}
        best = min(choices, key=lambda offset: sum(_meet(choices[offset], o) for o in others))
        boxes.append(choices[best])
        offsets.append(best)
    return offsets


def _label_box(x: float, y: float, offset: tuple[int, int], title: str) -> Box:
    width, height = LETTER_PT[0] * len(title), LETTER_PT[1]
    x0, y0 = x + offset[0] - (width if offset[0] < 0 else 0), y + offset[1]
    return x0, y0, x0 + width, y0 + height


def _meet(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _draw_points(panel: Panel, rows: Sequence[Mapping[str, Any]], color: str, label: str) -> None:
    errors = [row["over_s"]["all"].get("error_db", 0.0) if row["over_s"] else 0.0 for row in rows]
    panel.errorbar(
        [row["cpu_s_per_mp"] for row in rows],
        [row["gain_db"] for row in rows],
        yerr=errors,
        fmt="o",
        color=color,
        capsize=2,
        label=label,
    )
