"""The page of a display: luminance over level, and how far steps lie off a plain curve."""

from typing import Final

import numpy as np

from camkit.calibration.tone import ToneFacts
from camkit.report.figure import BLUE, Figure, chart, new_figure, to_png
from camkit.report.pages.page import Page, Picture, Section, Table, sentences, to_html

_POINTS: Final = 256
_CAPTION: Final = (
    "Luminance over level, and the curve fitted, on two scales. Below: how far steps lie off it."
)


def tone_html(facts: ToneFacts) -> str:
    """Return the page."""
    rest = facts.residuals
    if rest is None:
        rest = np.full(facts.levels.size, np.nan)
    rows = [
        (f"{level:g}", f"{light:.6g}", "-" if np.isnan(deviation) else f"{100 * deviation:+.2f}")
        for level, light, deviation in zip(facts.levels, facts.luminance, rest, strict=True)
    ]
    parts = (
        sentences(*facts.notes),
        Table(header=("level", "luminance", "off the curve, %"), rows=rows),
        Picture(_CAPTION, to_png(draw_tone(facts))),
    )
    return to_html(Page(title="Tone curve of a display", sections=[Section("Grey steps", parts)]))


@chart
def draw_tone(facts: ToneFacts) -> Figure:
    """Draw luminance over level, even and logarithmic, and the residuals of the fitted curve."""
    figure = new_figure(8.0, 5.0)
    grid = figure.add_gridspec(2, 2, height_ratios=(2, 1))
    even, decades = (figure.add_subplot(grid[0, column]) for column in (0, 1))
    lower = figure.add_subplot(grid[1, :])
    for panel in (even, decades):
        panel.plot(facts.levels, facts.luminance, "o", color=BLUE)
        if facts.curve is not None:
            levels = np.linspace(facts.levels[0], facts.levels[-1], _POINTS)
            panel.plot(levels, facts.curve.at(levels), color="black", linewidth=0.8)
        panel.set_xlabel("level")
    decades.set_yscale("log")
    even.set_ylabel("relative luminance")
    rest = facts.residuals
    if rest is not None:
        lower.vlines(facts.levels, 0, 100 * rest, color=BLUE)
        lower.plot(facts.levels, 100 * rest, "o", color=BLUE)
        lower.axhline(0, color="black", linewidth=0.6)
    lower.set(xlabel="level", ylabel="off the curve, %")
    return figure
