"""The chart: time against PSNR, one panel per camera, one below the other.

Marker area follows peak memory, the line is the Pareto front, the dashed line the input.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from camkit.report.bench.pareto import pareto_front
from camkit.report.bench.row import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

COLORS: Final = {
    "network": "#1f6fb4",
    "reference": "#d1661b",
    "classical": "#6b7b3a",
    "develop": "#555555",
}
FRONT_COLOR: Final = "#cdb4e6"
AREA_PER_GB: Final = 220.0
"""Marker area, in square points, of a peak memory of 1 GB."""
_PANEL_SIZE: Final = (8.4, 6.0)
_NEAR_PX: Final = 7
_FAR_PX: Final = 22


def plottable(rows: Sequence[Row], camera: str) -> list[Row]:
    """Give the rows of a camera that have both a time and a PSNR."""
    return [
        row
        for row in rows
        if row["camera"] == camera
        and row["seconds_median"] is not None
        and row.get("psnr_db") is not None
    ]


def draw_chart(report: dict[str, Any], *, svg: Path, png: Path) -> bool:
    """Write the chart as SVG and PNG.

    Args:
        report: See `camkit.report.bench.run`.
        svg: File to write.
        png: File to write.

    Returns:
        False if there is nothing to draw, or matplotlib is not installed.
    """
    cameras = [label for label in report["cameras"] if plottable(report["rows"], label)]
    if not cameras or not has_matplotlib():
        return False
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = _PANEL_SIZE
    figure = Figure(figsize=(width, height * len(cameras)), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    for number, label in enumerate(cameras, start=1):
        panel = figure.add_subplot(len(cameras), 1, number)
        _draw_panel(panel, report, label)
    _save(figure, svg, png)
    return True


def has_matplotlib() -> bool:
    """Tell whether charts can be drawn here."""
    from importlib import util

    return util.find_spec("matplotlib") is not None


def _save(figure: "Figure", svg: Path, png: Path) -> None:
    from matplotlib import rc_context

    # Text stays text, ids and date do not change from run to run.
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "camkit"}):
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    figure.savefig(png, format="png", metadata={"Software": None})


def _draw_panel(panel: "Panel", report: dict[str, Any], camera: str) -> None:
    rows = plottable(report["rows"], camera)
    facts = report["cameras"][camera]
    seconds = [row["seconds_median"] for row in rows]
    panel.set_xscale("log")
    panel.set_xlim(min(seconds) / 1.6, max(seconds) * 2.2)
    _draw_input(panel, rows)
    _draw_front(panel, rows)
    for row in rows:
        _draw_point(panel, row)
    low, high = panel.get_ylim()
    panel.set_ylim(low - 0.06 * (high - low), high + 0.08 * (high - low))
    _tidy_axis(panel)
    panel.set_xlabel(
        f"seconds per capture of {facts['width']} x {facts['height']} px, file to EXR in a fresh "
        "process (log scale)"
    )
    panel.set_ylabel("PSNR, dB")
    panel.set_title(_title(camera, rows, facts), fontsize=11, loc="left")
    panel.grid(visible=True, which="both", color="#dddddd", linewidth=0.5)
    panel.set_axisbelow(True)
    _draw_legend(panel, rows)
    _place_labels(panel, rows)


def _title(camera: str, rows: Sequence[Row], facts: dict[str, Any]) -> str:
    lenses = "+".join(sorted({row["psf"] for row in rows if row["psf"]}))
    words = {"fresh": "lenses fabricated afresh", "bundle": "the bundle's own PSF"}
    noisy = sum(bool(row["noisy"]) for row in rows)
    warning = f"\n{noisy} of {len(rows)} times are noisy" if noisy else ""
    return f"{camera}: {facts['accuracy']}; {words.get(lenses, lenses)}{warning}"


def _tidy_axis(panel: "Panel") -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())


def _draw_input(panel: "Panel", rows: Sequence[Row]) -> None:
    level = next((row["input_psnr_db"] for row in rows if row["input_psnr_db"] is not None), None)
    if level is not None:
        panel.axhline(level, color="#999999", linestyle="--", linewidth=1)
        panel.annotate(
            f"input {level:.2f} dB",
            (0.99, level),
            xycoords=panel.get_yaxis_transform(),
            xytext=(0, 3),
            textcoords="offset points",
            ha="right",
            fontsize=8,
            color="#777777",
        )


def _draw_front(panel: "Panel", rows: Sequence[Row]) -> None:
    points = [(row["seconds_median"], row["psnr_db"]) for row in rows]
    front = [points[index] for index in pareto_front(points)]
    panel.step(
        [x for x, _ in front],
        [y for _, y in front],
        where="post",
        color=FRONT_COLOR,
        linewidth=2,
        zorder=1,
    )


def _draw_point(panel: "Panel", row: Row) -> None:
    color = COLORS.get(_group(row), "#8855aa")
    x, y = row["seconds_median"], row["psnr_db"]
    error = row.get("gain_se_psnr_db")
    if error is not None:
        panel.errorbar(x, y, yerr=error, color=color, linewidth=1, capsize=3, zorder=2)
    panel.errorbar(
        x,
        y,
        xerr=[[x - row["seconds_min"]], [row["seconds_p90"] - x]],
        color=color,
        linewidth=1,
        alpha=0.6,
        zorder=2,
    )
    hollow = row["variant"]
    panel.scatter(
        [x],
        [y],
        s=_area_pt2(row),
        facecolors="none" if hollow else color,
        edgecolors=color,
        alpha=0.8,
        linewidths=1.2,
        zorder=3,
    )


def _group(row: Row) -> str:
    return "reference" if row["bundle"] != row["camera"] else str(row["kind"])


def _draw_legend(panel: "Panel", rows: Sequence[Row]) -> None:
    from matplotlib.lines import Line2D

    def dot(color: str, size_pt2: float, text: str, *, hollow: bool = False) -> Line2D:
        return Line2D(
            [],
            [],
            linestyle="none",
            marker="o",
            markersize=math.sqrt(size_pt2),
            markerfacecolor="none" if hollow else color,
            markeredgecolor=color,
            alpha=0.8,
            label=text,
        )

    groups = dict.fromkeys(_group(row) for row in rows)
    handles = [dot(COLORS.get(group, "#8855aa"), 40, group) for group in groups]
    if any(row["variant"] for row in rows):
        handles.append(dot("#555555", 40, "variant", hollow=True))
    handles.append(dot("#bbbbbb", AREA_PER_GB, "1 GB peak memory"))
    handles.append(Line2D([], [], color=FRONT_COLOR, linewidth=2, label="Pareto front"))
    if any(row.get("gain_se_psnr_db") for row in rows):
        text = "+-1 standard error of the gain over pictures"
        handles.append(Line2D([], [], color="#555555", linewidth=1, marker="_", label=text))
    panel.legend(
        handles=handles,
        fontsize=7.5,
        ncols=min(4, len(handles)),
        loc="upper center",
        bbox_to_anchor=(0.5, -0.11),
        frameon=False,
    )


def _place_labels(panel: "Panel", rows: Sequence[Row]) -> None:
    """Put every label beside its marker where it covers neither marker nor label."""
    figure = panel.figure
    figure.canvas.draw()  # places are known only then
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    taken = [box for row in rows for box in _drawn_boxes(panel, row)]
    for row in sorted(rows, key=lambda r: (r["variant"], r["seconds_median"])):
        point = (row["seconds_median"], row["psnr_db"])
        text = panel.annotate(
            row["label"],
            point,
            xytext=(0, 0),
            textcoords="offset points",
            fontsize=7.5 if row["variant"] else 9.5,
            fontweight="normal" if row["variant"] else "bold",
            color="#333333",
            zorder=5,
        )
        x, y = panel.transData.transform(point)
        size = text.get_window_extent(renderer)
        places = [
            (_box_at((x, y), offset, (size.width, size.height), figure.dpi), offset)
            for offset in _offsets(_reach_pt(row))
        ]
        costs = [_overlap(box, taken, panel.bbox) for box, _ in places]
        box, best = places[costs.index(min(costs))]
        text.set(position=best[:2], ha=best[2], va=best[3])
        taken.append(box)


def _offsets(reach_pt: float) -> list[tuple[float, float, str, str]]:
    """Give places around a marker, the best ones first: (x, y) in points and the alignments."""
    found: list[tuple[float, float, str, str]] = []
    for gap in (_NEAR_PX / 2, _FAR_PX / 2, _FAR_PX, 1.6 * _FAR_PX, 2.4 * _FAR_PX):
        far = reach_pt + gap
        found += [
            (0.7 * far, 0.7 * far, "left", "bottom"),
            (far, 0, "left", "center"),
            (0.7 * far, -0.7 * far, "left", "top"),
            (0, far, "center", "bottom"),
            (0, -far, "center", "top"),
            (-0.7 * far, 0.7 * far, "right", "bottom"),
            (-far, 0, "right", "center"),
            (-0.7 * far, -0.7 * far, "right", "top"),
        ]
    return found


def _box_at(
    point_px: tuple[float, float],
    offset: tuple[float, float, str, str],
    size_px: tuple[float, float],
    dpi: float,
) -> "Bbox":
    """Give the box of a text of a known size beside a point."""
    from matplotlib.transforms import Bbox

    shares = {"left": 0.0, "bottom": 0.0, "center": 0.5, "right": 1.0, "top": 1.0}
    left = point_px[0] + offset[0] * dpi / 72 - shares[offset[2]] * size_px[0]
    low = point_px[1] + offset[1] * dpi / 72 - shares[offset[3]] * size_px[1]
    return Bbox.from_extents(left, low, left + size_px[0], low + size_px[1])


def _drawn_boxes(panel: "Panel", row: Row) -> "list[Bbox]":
    """Give what a row covers on the canvas: its marker, and its bars of some width."""
    from matplotlib.transforms import Bbox

    def place(x: float, y: float) -> tuple[float, float]:
        point = panel.transData.transform((x, y))
        return float(point[0]), float(point[1])

    seconds, psnr = row["seconds_median"], row["psnr_db"]
    error = row.get("gain_se_psnr_db") or 0.0
    x, y = place(seconds, psnr)
    left, low = place(row["seconds_min"], psnr - error)
    right, high = place(row["seconds_p90"], psnr + error)
    radius = _reach_pt(row) * panel.figure.dpi / 72
    return [
        Bbox.from_extents(x - radius, y - radius, x + radius, y + radius),
        Bbox.from_extents(left, y - 1, right, y + 1),
        Bbox.from_extents(x - 1, low, x + 1, high),
    ]


def _reach_pt(row: Row) -> float:
    """Give the radius of a marker in points."""
    return math.sqrt(_area_pt2(row)) / 2


def _area_pt2(row: Row) -> float:
    return AREA_PER_GB * (row["peak_rss_mb"] or 0) / 1000 or 20.0


def _overlap(box: "Bbox", taken: Sequence["Bbox"], inside: "Bbox") -> float:
    """Give the area that a box shares with others, and that lies outside the panel."""
    own = float(box.width * box.height)
    return own - _shared(box, inside) + sum(_shared(box, other) for other in taken)


def _shared(one: "Bbox", other: "Bbox") -> float:
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return max(float(wide), 0.0) * max(float(high), 0.0)
