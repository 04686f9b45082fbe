"""The chart: time against PSNR on common axes, and below PSNR over the field for every ISO.

A colour is a camera, a marker a method; its area follows peak memory.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from camkit.report.bench.row import Row
from camkit.report.bench.shown.field_panels import draw_field_panel, field_isos, shown_rows
from camkit.report.bench.shown.front_panel import (
    draw_front_panel,
    label_front_panel,
    plottable,
)
from camkit.report.bench.shown.legend import draw_legend
from camkit.report.bench.shown.looks import Looks, looks_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

WIDTH_IN: Final = 10.5
FRONT_IN: Final = 6.2
FIELD_IN: Final = 3.4
ALL_METHODS: Final = "all plain methods"
BEST_TWO: Final = "of every camera the best\nmethod with a network\nand without"


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

    rows = [row for camera in cameras for row in plottable(report["rows"], camera)]
    looks, shown = looks_of(cameras, rows), shown_rows(rows)
    isos = field_isos(shown)
    height = FRONT_IN + (FIELD_IN if isos else 0)
    figure = Figure(figsize=(WIDTH_IN, height), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    ratios = [FRONT_IN, FIELD_IN] if isos else [FRONT_IN]
    grid = figure.add_gridspec(len(ratios), max(len(isos), 1), height_ratios=ratios)
    panel = figure.add_subplot(grid[0, :])
    draw_front_panel(panel, report, rows, looks)
    places = [grid[1, column] for column in range(len(isos))]
    _draw_field(figure, places, shown, isos, looks)
    what = (ALL_METHODS if len(cameras) == 1 else BEST_TWO) if isos else ""
    draw_legend(figure, rows, looks, below=what)
    _settle(figure)
    label_front_panel(panel, rows, looks)
    _save(figure, svg, png)
    return True


def has_matplotlib() -> bool:
    """Return whether charts can be drawn here."""
    from importlib import util

    return util.find_spec("matplotlib") is not None


def _draw_field(
    figure: "Figure", places: list[Any], rows: list[Row], isos: tuple[float, ...], looks: Looks
) -> None:
    first: Panel | None = None
    for place, iso in zip(places, isos, strict=True):
        panel = figure.add_subplot(place, sharex=first, sharey=first)
        draw_field_panel(panel, rows, iso, looks)
        if first is None:
            panel.set_ylabel("PSNR, dB", fontsize=9)
        first = first or panel


def _settle(figure: "Figure") -> None:
    """Fix the layout: where labels go depends on it, and they must not move it again."""
    figure.canvas.draw()
    figure.set_layout_engine("none")


def _save(figure: "Figure", svg: Path, png: Path) -> None:
    from matplotlib import rc_context

    # Text stays text, ids and date do not change from run to run.
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "camkit"}):
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    figure.savefig(png, format="png", metadata={"Software": None})
