"""The page of pairs: how well each picture lies on its capture, and the colours of the display."""

from typing import Any, Final

import numpy as np

from camkit.calibration.display.pairs import Pairs
from camkit.calibration.display.primaries import Primaries
from camkit.report.figure import BLUE, Figure, chart, new_figure, to_png
from camkit.report.pages.page import Page, Picture, Section, Table, sentences, to_html

MOST_ARROWS: Final = 2000
LONGEST: Final = 0.06
"""Of the width of the capture: how long the longest arrow is drawn."""
_HEADER: Final = ("name", "capture", "residual, px", "correlation", "reference, px")
_OF_COLOURS: Final = (
    "Light of the sensor's colours for full red, green and blue of the display, and what is there "
    "without any; below, what this leaves of each colour shown, in % of the brightest white, by "
    "the sensor's red, green and blue."
)


def pairs_html(pairs: Pairs) -> str:
    """Return the page."""
    rows = [
        (
            pair.target.name,
            pair.path.name,
            f"{pair.residual_px:.3f}",
            f"{pair.correlation:.4f}",
            "x".join(str(side) for side in pair.reference_px[2:]),
        )
        for pair in pairs.pairs
    ]
    longest = max(float(np.linalg.norm(pair.shifts_px, axis=1).max()) for pair in pairs.pairs)
    caption = (
        "What is left between captures and pictures, tile by tile, over the capture; the longest "
        f"arrow is {longest:.3f} px."
    )
    table = Table(header=_HEADER, rows=rows)
    parts = (sentences(*pairs.notes), table, Picture(caption, to_png(draw_shifts(pairs))))
    sections = [Section("Pairs", parts)]
    if pairs.primaries is not None:
        sections.append(_colours(pairs.primaries))
    return to_html(Page(title="Pairs of shown pictures and captures", sections=sections))


@chart
def draw_shifts(pairs: Pairs) -> Figure:
    """Draw what is left of every pair as arrows, enlarged."""
    figure = new_figure(7.0, 7.0 * pairs.size[1] / pairs.size[0] + 0.4)
    panel = figure.add_subplot()
    at = np.concatenate([pair.places_px for pair in pairs.pairs])
    shifts = np.concatenate([pair.shifts_px for pair in pairs.pairs])
    every = 1 + len(at) // MOST_ARROWS
    factor = LONGEST * pairs.size[0] / max(float(np.linalg.norm(shifts, axis=1).max()), 1e-9)
    arrows: Any = {"angles": "xy", "scale_units": "xy", "scale": 1, "color": BLUE, "width": 0.002}
    panel.quiver(*at[::every].T, *(factor * shifts[::every]).T, **arrows)
    panel.set(
        xlim=(0, pairs.size[0]),
        ylim=(pairs.size[1], 0),
        aspect="equal",
        title=f"{factor:.0f} times enlarged",
    )
    return figure


def _colours(primaries: Primaries) -> Section:
    rows = [
        (f"sensor {name}", *(f"{value:.4f}" for value in (*row, rest)))
        for name, row, rest in zip(
            ("red", "green", "blue"), primaries.matrix, primaries.offset, strict=True
        )
    ]
    rows += [
        (f"left, %: {name}", *(f"{100 * value:+.2f}" for value in row), "")
        for name, row in zip(primaries.names, primaries.residuals, strict=True)
    ]
    table = Table(header=("", "red", "green", "blue", "none"), rows=rows)
    return Section("Colours of the display", (_OF_COLOURS, table))
