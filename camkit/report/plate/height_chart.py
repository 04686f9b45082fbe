"""The relief as it is made: whole, its middle, and how many cells have which height."""

from typing import TYPE_CHECKING, Final

from camkit.report.figure import GRID_COLOR, new_figure
from camkit.report.plate.facts import PlateFacts
from camkit.units import UM_PER_MM

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN: Final = 600
"""Cells along a side of the whole; every so many are drawn."""
_MIDDLE: Final = 120


def draw_heights(facts: PlateFacts) -> "Figure":
    """Draw the heights."""
    height_um = facts.plate.made_um.numpy()
    cells, cell_mm = height_um.shape[0], facts.plate.cell_um / UM_PER_MM
    figure = new_figure(11.5, 3.6)
    whole, middle, counts = figure.subplots(1, 3)
    half_mm = cells * cell_mm / 2
    step = max(1, cells // _SHOWN)
    low, high = float(height_um.min()), float(height_um.max())
    shown = whole.imshow(
        height_um[::step, ::step],
        cmap="viridis",
        vmin=low,
        vmax=high,
        extent=(-half_mm, half_mm, half_mm, -half_mm),
    )
    whole.set_title("whole, mm" + (f" (one cell of {step})" if step > 1 else ""), fontsize=9)
    width = min(_MIDDLE, cells)
    begin = (cells - width) // 2
    inner_mm = width * cell_mm / 2
    middle.imshow(
        height_um[begin : begin + width, begin : begin + width],
        cmap="viridis",
        vmin=low,
        vmax=high,
        extent=(-inner_mm, inner_mm, inner_mm, -inner_mm),
        interpolation="nearest",
    )
    middle.set_title(f"the middle {width} cells, mm", fontsize=9)
    figure.colorbar(shown, ax=[whole, middle], shrink=0.8).set_label("height, µm", fontsize=8)
    counts.hist(height_um.ravel(), bins=64, color="#1f6fb4")
    counts.set_title("cells by height, µm", fontsize=9)
    counts.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
    for panel in (whole, middle, counts):
        panel.tick_params(labelsize=7)
    return figure
