"""The page of a display: luminance over level, and how far steps lie off a plain curve."""

from typing import TYPE_CHECKING, Final

import numpy as np

from camkit.calibration.tone import ToneFacts
from camkit.report.calibration.page import Section, Table, sentences, to_html
from camkit.report.figure import GRID_COLOR, new_figure, to_png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POINTS: Final = 256


def tone_html(facts: ToneFacts) -> str:
    """Return the page."""
    rest = facts.residuals
    if rest is None:
        rest = np.full(facts.levels.size, np.nan)
    rows = tuple(
        (f"{level:g}", f"{light:.6g}", "-" if np.isnan(off) else f"{100 * off:+.2f}")
        for level, light, off in zip(facts.levels, facts.luminance, rest, strict=True)
    )
    pictures = {
        "Luminance over level, and the curve fitted, on two scales. Below: how far steps lie off "
        "it.": to_png(draw_tone(facts))
    }
    table = Table(header=("level", "luminance", "off the curve, %"), rows=rows)
    section = Section(
        title="Grey steps", paragraph=sentences(*facts.notes), table=table, pictures=pictures
    )
    return to_html("Tone curve of a display", [section])


def draw_tone(facts: ToneFacts) -> "Figure":
    """Draw luminance over level, even and logarithmic, and the residuals of the fitted curve."""
    figure = new_figure(8.0, 5.0)
    grid = figure.add_gridspec(2, 2, height_ratios=(2, 1))
    even, decades = (figure.add_subplot(grid[0, column]) for column in (0, 1))
    below = figure.add_subplot(grid[1, :])
    for panel in (even, decades):
        panel.plot(facts.levels, facts.luminance, "o", color="#1f6fb4", markersize=4)
        if facts.curve is not None:
            levels = np.linspace(facts.levels[0], facts.levels[-1], _POINTS)
            panel.plot(levels, facts.curve.at(levels), color="black", linewidth=0.8)
        panel.set_xlabel("level", fontsize=8)
    decades.set_yscale("log")
    even.set_ylabel("relative luminance", fontsize=8)
    rest = facts.residuals
    if rest is not None:
        below.vlines(facts.levels, 0, 100 * rest, color="#1f6fb4", linewidth=1)
        below.plot(facts.levels, 100 * rest, "o", color="#1f6fb4", markersize=4)
        below.axhline(0, color="black", linewidth=0.6)
    below.set_xlabel("level", fontsize=8)
    below.set_ylabel("off the curve, %", fontsize=8)
    for panel in (even, decades, below):
        panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
        panel.tick_params(labelsize=7)
    return figure
