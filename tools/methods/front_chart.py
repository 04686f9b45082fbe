"""The chart of the front of methods: decibels against CPU-seconds a megapixel."""

import json
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
NEAR_TIMES: Final = 2.5
NEAR_DB: Final = 0.6
"""Points whose names might meet: seconds within a factor, decibels within a difference."""
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
    for row, offset in zip(rows, label_places(rows), strict=True):
        panel.annotate(
            row["title"],
            (row["cpu_s_per_mp"], row["gain_db"]),
            xytext=offset,
            textcoords="offset points",
            fontsize=7,
            color=COLORS[row["kind"]],
        )
    panel.set_xscale("log")
    low, high = panel.get_xlim()
    ticks = [tick for tick in TICKS_S if low < tick < 2 * high]
    panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.set_xticks([], minor=True)
    panel.set_xlim(low, high * 2)
    panel.set_xlabel("CPU-seconds a megapixel, one thread, from developed to restored planes")
    panel.set_ylabel("dB gained over the picture as taken\n(bars: error of the difference to S)")
    panel.legend(loc="best")
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


def label_places(rows: Sequence[Mapping[str, Any]]) -> list[tuple[int, int]]:
    """Return (right, up) in points of every name: above its point, lower where others lie near."""
    places = []
    for row in rows:
        gaps_db = [
            other["gain_db"] - row["gain_db"]
            for other in rows
            if other is not row
            and 1 / NEAR_TIMES < other["cpu_s_per_mp"] / row["cpu_s_per_mp"] < NEAR_TIMES
            and abs(other["gain_db"] - row["gain_db"]) < NEAR_DB
        ]
        crowded_above, crowded_below = any(g >= 0 for g in gaps_db), any(g < 0 for g in gaps_db)
        places.append((7, (-3 if crowded_below else -9) if crowded_above else 3))
    return places


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
