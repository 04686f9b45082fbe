"""Time against PSNR: all cameras on common axes, each with its Pareto front and its input."""

from collections.abc import Container, Sequence
from typing import TYPE_CHECKING, Any, Final

from camkit.report.bench.pareto import pareto_front
from camkit.report.bench.row import Row
from camkit.report.bench.shown.labels import Label, place_labels, places_along, places_around
from camkit.report.bench.shown.looks import Looks, area_pt2, reach_pt, seconds_per_mp
from camkit.report.figure import Panel

if TYPE_CHECKING:
    from matplotlib.transforms import Bbox

FRONT_ALPHA: Final = 0.35
NOT_COMPARABLE: Final = (
    "not judged on the same pictures: compare methods of one camera, not cameras"
)
FEW_TICKS_FROM: Final = 20.0
"""Ratio of the ends of the time axis from which on fewer ticks are told."""


def plottable(rows: Sequence[Row], camera: str) -> list[Row]:
    """Return the rows of a camera that have both a time and a PSNR."""
    return [
        row
        for row in rows
        if row["camera"] == camera
        and row["seconds_median"] is not None
        and row.get("psnr_db") is not None
    ]


def timed_alone(rows: Sequence[Row], cameras: Container[str]) -> list[Row]:
    """Return the rows of some cameras that have a time and no PSNR."""
    return [
        row
        for row in rows
        if row["camera"] in cameras
        and row["seconds_median"] is not None
        and row.get("psnr_db") is None
    ]


def draw_front_panel(panel: Panel, report: dict[str, Any], rows: list[Row], looks: Looks) -> None:
    """Draw everything but the labels, which need the final layout.

    Args:
        panel: Empty.
        report: See `camkit.report.bench.run`.
        rows: Those that are drawn.
        looks: Of their cameras and methods.
    """
    alone = timed_alone(report["rows"], looks.colors)
    seconds = [seconds_per_mp(row) for row in (*rows, *alone)]
    panel.set(xscale="log", xlim=(min(seconds) / 1.5, max(seconds) * 1.8))
    for camera, color in looks.colors.items():
        camera_rows = [row for row in rows if row["camera"] == camera]
        level = input_level(camera_rows)
        if level is not None:
            panel.axhline(level, color=color, linestyle="--", linewidth=1, alpha=0.7)
        _draw_front(panel, camera_rows, color)
    for row in rows:
        _draw_point(panel, row, looks)
    for row in alone:
        _draw_time(panel, row, looks)
    low, high = panel.get_ylim()
    panel.set_ylim(low - 0.06 * (high - low), high + 0.08 * (high - low))
    _tidy_axis(panel)
    panel.set(
        xlabel="seconds per megapixel, file to EXR in a fresh process, start-up included "
        "(log scale)",
        ylabel="PSNR, dB",
    )
    panel.set_title(title(report, rows), loc="left")
    panel.grid(visible=True, which="both")


def input_level(rows: Sequence[Row]) -> float | None:
    """Return the PSNR of a camera's input."""
    levels = (row["input_psnr_db"] for row in rows if row["input_psnr_db"] is not None)
    return next(levels, None)


def title(report: dict[str, Any], rows: Sequence[Row]) -> str:
    """Return what was judged and timed: once if all cameras share it, else for each of them."""
    cameras = list(dict.fromkeys(row["camera"] for row in rows))
    texts = {camera: _judged(report, rows, camera) for camera in cameras}
    if len(set(texts.values())) == 1:
        lines = [texts[cameras[0]] if cameras[1:] else f"{cameras[0]}: {texts[cameras[0]]}"]
    else:
        lines = [f"{camera}: {text}" for camera, text in texts.items()]
    if len({report["cameras"][camera]["accuracy"] for camera in cameras}) > 1:
        lines.append(NOT_COMPARABLE)
    noisy = sum(bool(row["noisy"]) for row in rows)
    if noisy:
        lines.append(f"{noisy} of {len(rows)} times are noisy")
    return "\n".join(lines)


def _judged(report: dict[str, Any], rows: Sequence[Row], camera: str) -> str:
    facts = report["cameras"][camera]
    words = {"fresh": "lenses fabricated afresh", "bundle": "the bundle's own PSF"}
    lenses = "+".join(sorted({r["psf"] for r in rows if r["psf"] and r["camera"] == camera}))
    return (
        f"{facts['accuracy']}; {words.get(lenses, lenses)}\n"
        f"    timed on {facts['width']} x {facts['height']} px"
    )


def _draw_front(panel: Panel, rows: Sequence[Row], color: str) -> None:
    points = [(seconds_per_mp(row), row["psnr_db"]) for row in rows]
    front = [points[index] for index in pareto_front(points)]
    panel.step(
        [x for x, _ in front],
        [y for _, y in front],
        where="post",
        color=color,
        alpha=FRONT_ALPHA,
        linewidth=2,
        zorder=1,
    )


def _draw_point(panel: Panel, row: Row, looks: Looks) -> None:
    color = looks.color(row)
    x, y = seconds_per_mp(row), row["psnr_db"]
    error = row.get("gain_se_psnr_db")
    if error is not None:
        panel.errorbar(x, y, yerr=error, color=color, linewidth=1, capsize=3, zorder=2, alpha=0.7)
    bars = [[x - seconds_per_mp(row, "seconds_min")], [seconds_per_mp(row, "seconds_p90") - x]]
    panel.errorbar(x, y, xerr=bars, color=color, linewidth=1, alpha=0.6, zorder=2)
    panel.scatter(
        [x],
        [y],
        s=area_pt2(row),
        marker=looks.marker(row),
        facecolors="none" if row["variant"] else color,
        edgecolors=color,
        linewidths=1.2,
        alpha=0.9,
        zorder=3 if row["variant"] else 4,
    )


def _draw_time(panel: Panel, row: Row, looks: Looks) -> None:
    """Draw a row that was not judged: where it stands in time, at no height."""
    x, color = seconds_per_mp(row), looks.color(row)
    panel.axvline(x, color=color, linestyle=":", linewidth=1.2, alpha=0.8, zorder=1)
    panel.annotate(
        f"{row['label']}: not judged",
        (x, 0.98),
        xycoords=("data", "axes fraction"),
        xytext=(-3, 0),
        textcoords="offset points",
        rotation=90,
        ha="right",
        va="top",
        fontsize=7.5,
        color=color,
    )


def _tidy_axis(panel: Panel) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = panel.get_xlim()
    subs = (1.0, 2.0, 5.0) if high / low > FEW_TICKS_FROM else (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
    panel.xaxis.set_major_locator(LogLocator(subs=subs))
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())


def label_front_panel(panel: Panel, rows: Sequence[Row], looks: Looks) -> None:
    """Write beside every marker what it is, and at every input line whose it is."""
    obstacles = [box for row in rows for box in _drawn_boxes(panel, row)]
    inputs = _input_labels(panel, rows, looks)
    obstacles += [_line_box(panel, label.point[1]) for label in inputs]
    ordered = sorted(rows, key=lambda r: (r["variant"], seconds_per_mp(r)))
    place_labels(panel, [*inputs, *map(_label(looks), ordered)], obstacles)


def _label(looks: Looks) -> Any:
    def label(row: Row) -> Label:
        reach = reach_pt(row)
        return Label(
            text=row["label"],
            point=(seconds_per_mp(row), row["psnr_db"]),
            places=places_around(reach),
            color=looks.color(row) if len(looks.colors) > 1 else "#333333",
            size_pt=7.5 if row["variant"] else 9.0,
            bold=not row["variant"],
            gap_pt=reach,
        )

    return label


def _input_labels(panel: Panel, rows: Sequence[Row], looks: Looks) -> list[Label]:
    labels = []
    for camera, color in looks.colors.items():
        level = input_level([row for row in rows if row["camera"] == camera])
        if level is not None:
            name = "input" if len(looks.colors) == 1 else f"{camera} input"
            labels.append(
                Label(
                    text=f"{name} {level:.2f} dB",
                    point=(panel.get_xlim()[1], level),
                    places=places_along(),
                    color=color,
                    size_pt=7.5,
                )
            )
    return labels


def _line_box(panel: Panel, level: float) -> "Bbox":
    """Return what the line of an input covers on the canvas."""
    from matplotlib.transforms import Bbox

    y = float(panel.transData.transform((panel.get_xlim()[0], level))[1])
    return Bbox.from_extents(panel.bbox.x0, y - 1, panel.bbox.x1, y + 1)


def _drawn_boxes(panel: Panel, row: Row) -> "list[Bbox]":
    """Return what a row covers on the canvas: its marker, and its bars of some width."""
    from matplotlib.transforms import Bbox

    def place(x: float, y: float) -> tuple[float, float]:
        point = panel.transData.transform((x, y))
        return float(point[0]), float(point[1])

    psnr = row["psnr_db"]
    error = row.get("gain_se_psnr_db") or 0.0
    x, y = place(seconds_per_mp(row), psnr)
    left, low = place(seconds_per_mp(row, "seconds_min"), psnr - error)
    right, high = place(seconds_per_mp(row, "seconds_p90"), psnr + error)
    radius = reach_pt(row) * panel.figure.dpi / 72
    return [
        Bbox.from_extents(x - radius, y - radius, x + radius, y + radius),
        Bbox.from_extents(left, y - 1, right, y + 1),
        Bbox.from_extents(x - 1, low, x + 1, high),
    ]
