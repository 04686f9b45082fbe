"""The chart: time against PSNR on common axes, and below PSNR over the field for every ISO.

A colour is a camera, a marker a method; its area follows peak memory.
"""

from importlib import util
from typing import Any, Final

from camkit.report.bench.row import Row
from camkit.report.bench.shown.field_panels import draw_field_panel, field_isos, shown_rows
from camkit.report.bench.shown.front_panel import (
    draw_front_panel,
    label_front_panel,
    plottable,
)
from camkit.report.bench.shown.legend import draw_legend
from camkit.report.bench.shown.looks import Looks, looks_of
from camkit.report.figure import Figure, Panel, chart, new_figure

WIDTH_IN: Final = 10.5
FRONT_IN: Final = 6.2
FIELD_IN: Final = 3.4
ALL_METHODS: Final = "all plain methods"
BEST_TWO: Final = "of every camera the best\nmethod with a network\nand without"


def draw_chart(report: dict[str, Any]) -> Figure | None:
    """Return the chart; None if there is nothing to draw, or matplotlib is not installed.

    Args:
        report: See `camkit.report.bench.run`.
    """
    cameras = [label for label in report["cameras"] if plottable(report["rows"], label)]
    return _drawn(report, cameras) if cameras and has_matplotlib() else None


def has_matplotlib() -> bool:
    """Return whether charts can be drawn here."""
    return util.find_spec("matplotlib") is not None


@chart
def _drawn(report: dict[str, Any], cameras: list[str]) -> Figure:
    rows = [row for camera in cameras for row in plottable(report["rows"], camera)]
    looks, shown = looks_of(cameras, rows), shown_rows(rows)
    isos = field_isos(shown)
    ratios = [FRONT_IN, FIELD_IN] if isos else [FRONT_IN]
    figure = new_figure(WIDTH_IN, sum(ratios))
    grid = figure.add_gridspec(len(ratios), max(len(isos), 1), height_ratios=ratios)
    panel = figure.add_subplot(grid[0, :])
    draw_front_panel(panel, report, rows, looks)
    _draw_field(figure, [grid[1, column] for column in range(len(isos))], shown, isos, looks)
    what = (ALL_METHODS if len(cameras) == 1 else BEST_TWO) if isos else ""
    draw_legend(figure, rows, looks, below=what)
    # where labels go depends on the layout, and they must not move it again
    figure.canvas.draw()
    figure.set_layout_engine("none")
    label_front_panel(panel, rows, looks)
    return figure


def _draw_field(
    figure: Figure, places: list[Any], rows: list[Row], isos: tuple[float, ...], looks: Looks
) -> None:
    first: Panel | None = None
    for place, iso in zip(places, isos, strict=True):
        panel = figure.add_subplot(place, sharex=first, sharey=first)
        draw_field_panel(panel, rows, iso, looks)
        if first is None:
            panel.set_ylabel("PSNR, dB")
        first = first or panel
