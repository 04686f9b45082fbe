"""The chart: time against PSNR on common axes, and below PSNR over the field for every ISO.

A colour is a camera, a marker a method; its area follows peak memory.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Final

from camkit.report.bench.row import Row
from camkit.report.bench.shown.front_panel import (
    draw_front_panel,
    label_front_panel,
    plottable,
)
from camkit.report.bench.shown.looks import Looks, draw_legend, looks_of
from camkit.report.figure import Figure, Panel, chart, new_figure
from camkit.runtime.plan.decision import DEVELOP

Cell = dict[str, Any]
WIDTH_IN: Final = 10.5
FRONT_IN: Final = 6.2
FIELD_IN: Final = 3.4
ALL_METHODS: Final = "all plain methods"
BEST_TWO: Final = "of every camera the best\nmethod with a network\nand without"


def draw_chart(report: dict[str, Any]) -> Figure | None:
    """Return the chart; None if there is nothing to draw.

    Args:
        report: See `camkit.report.bench.run`.
    """
    cameras = [label for label in report["cameras"] if plottable(report["rows"], label)]
    return _draw_figure(report, cameras) if cameras else None


@chart
def _draw_figure(report: dict[str, Any], cameras: list[str]) -> Figure:
    rows = [row for camera in cameras for row in plottable(report["rows"], camera)]
    looks, panel_rows = looks_of(cameras, rows), shown_rows(rows)
    isos = field_isos(panel_rows)
    ratios = [FRONT_IN, FIELD_IN] if isos else [FRONT_IN]
    figure = new_figure(WIDTH_IN, sum(ratios))
    grid = figure.add_gridspec(len(ratios), max(len(isos), 1), height_ratios=ratios)
    panel = figure.add_subplot(grid[0, :])
    draw_front_panel(panel, report, rows, looks)
    _draw_field(figure, [grid[1, column] for column in range(len(isos))], panel_rows, isos, looks)
    what = (ALL_METHODS if len(cameras) == 1 else BEST_TWO) if isos else ""
    draw_legend(figure, rows, looks, lower_text=what)
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


def field_isos(rows: Iterable[Row]) -> tuple[float, ...]:
    """Return the ISOs of which there are panels: none where the field was not swept by pictures.

    Golden cases differ in what they show too, so a line through them would say nothing.
    """
    grids = [_grid(row) for row in rows]
    isos = dict.fromkeys(iso for grid in grids for iso in grid)
    return tuple(sorted(isos))


def is_swept(rows: Iterable[Row]) -> bool:
    """Return whether every picture was taken at every ISO and place."""
    for row in rows:
        cells = row.get("by_iso_and_field")
        if not cells:
            continue
        whole = len({c["iso"] for c in cells}) * len({c["field_share"] for c in cells})
        counts = {c["captures"] for c in cells}
        if len(cells) != whole or len(counts) > 1 or min(counts) < row["images"]:
            return False
    return True


def _grid(row: Row) -> dict[float, list[Cell]]:
    """Return ISO -> cells by place, if all pictures were taken at all of two or more places."""
    grid: dict[float, list[Cell]] = {}
    if not is_swept([row]):
        return grid
    for cell in row.get("by_iso_and_field", ()):
        if cell["field_mm"] is not None and cell.get("psnr_db") is not None:
            grid.setdefault(cell["iso"], []).append(cell)
    shares = {tuple(cell["field_share"] for cell in cells) for cells in grid.values()}
    full = len(shares) == 1 and len(next(iter(shares))) > 1
    return grid if full else {}


def shown_rows(rows: Sequence[Row]) -> list[Row]:
    """Choose what a panel can show: all plain methods of one camera; of several the best two each.

    Those are the best method with a network and the best one without.
    """
    plain = [row for row in rows if not row["variant"] and row["method"] != DEVELOP]
    cameras = dict.fromkeys(row["camera"] for row in plain)
    if len(cameras) == 1:
        return plain
    best_rows: list[Row] = []
    for camera in cameras:
        camera_rows = [row for row in plain if row["camera"] == camera and row["bundle"] == camera]
        for group in (
            [r for r in camera_rows if r["size"]],
            [r for r in camera_rows if not r["size"]],
        ):
            best_rows += sorted(group, key=lambda row: -float(row["psnr_db"]))[:1]
    return best_rows


def draw_field_panel(panel: Panel, rows: Sequence[Row], iso: float, looks: Looks) -> None:
    """Draw one ISO.

    Args:
        panel: Empty.
        rows: Those that are shown.
        iso: Sensitivity.
        looks: Of their cameras and methods.
    """
    cameras: set[str] = set()
    for row in rows:
        cells = _grid(row).get(iso, [])
        color = looks.color(row)
        if cells and row["camera"] not in cameras:
            cameras.add(row["camera"])
            _draw_line(panel, cells, "input_psnr_db", color=color, linestyle="--", alpha=0.7)
        _draw_line(panel, cells, "psnr_db", color=color, marker=looks.marker(row), markersize=5)
    panel.set_title(f"ISO {iso:g}", loc="left")
    panel.set_xlabel("distance from the axis, mm")


def _draw_line(panel: Panel, cells: Sequence[Cell], key: str, **look: Any) -> None:
    points = [cell for cell in cells if cell.get(key) is not None]
    panel.plot([c["field_mm"] for c in points], [c[key] for c in points], linewidth=1.2, **look)
