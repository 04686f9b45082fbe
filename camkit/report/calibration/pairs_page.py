"""The page of pairs: how well each picture lies on its capture, and the colours of the display."""

from typing import TYPE_CHECKING, Final

import numpy as np

from camkit.calibration.display.pairs import Pairs
from camkit.calibration.display.primaries import Primaries
from camkit.report.calibration.page import Section, Table, sentences, to_html
from camkit.report.figure import GRID_COLOR, new_figure, to_png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_ARROWS: Final = 2000
LONGEST: Final = 0.06
"""Of the width of the capture: how long the longest arrow is drawn."""


def pairs_html(found: Pairs) -> str:
    """Return the page."""
    rows = tuple(
        (
            pair.target.name,
            pair.path.name,
            f"{pair.residual_px:.3f}",
            f"{pair.correlation:.4f}",
            "x".join(str(side) for side in pair.reference_px[2:]),
        )
        for pair in found.pairs
    )
    header = ("name", "capture", "residual, px", "correlation", "reference, px")
    longest = max(float(np.linalg.norm(pair.shifts_px, axis=1).max()) for pair in found.pairs)
    sections = [
        Section(
            title="Pairs",
            paragraph=sentences(*found.notes),
            table=Table(header=header, rows=rows),
            pictures={
                "What is left between captures and pictures, tile by tile, over the capture; the "
                f"longest arrow is {longest:.3f} px.": to_png(draw_shifts(found))
            },
        )
    ]
    if found.primaries is not None:
        sections.append(_colours(found.primaries))
    return to_html("Pairs of shown pictures and captures", sections)


def draw_shifts(found: Pairs) -> "Figure":
    """Draw what is left of every pair as arrows, enlarged."""
    figure = new_figure(7.0, 7.0 * found.size[1] / found.size[0] + 0.4)
    axes = figure.add_subplot()
    at = np.concatenate([pair.places_px for pair in found.pairs])
    shifts = np.concatenate([pair.shifts_px for pair in found.pairs])
    every = 1 + len(at) // MOST_ARROWS
    factor = LONGEST * found.size[0] / max(float(np.linalg.norm(shifts, axis=1).max()), 1e-9)
    axes.quiver(
        *at[::every].T,
        *(factor * shifts[::every]).T,
        angles="xy",
        scale_units="xy",
        scale=1,
        color="#1f6fb4",
        width=0.002,
    )
    axes.set_xlim(0, found.size[0])
    axes.set_ylim(found.size[1], 0)
    axes.set_aspect("equal")
    axes.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
    axes.tick_params(labelsize=7)
    axes.set_title(f"{factor:.0f} times enlarged", fontsize=9)
    return figure


def _colours(primaries: Primaries) -> Section:
    rows = [
        (f"sensor {name}", *(f"{value:.4f}" for value in (*row, rest)))
        for name, row, rest in zip(
            ("red", "green", "blue"), primaries.matrix, primaries.offset, strict=True
        )
    ]
    rest = [
        (f"left, %: {name}", *(f"{100 * value:+.2f}" for value in row), "")
        for name, row in zip(primaries.names, primaries.residuals, strict=True)
    ]
    return Section(
        title="Colours of the display",
        paragraph=(
            "Light of the sensor's colours for full red, green and blue of the display, and what "
            "is there without any; below, what this leaves of each colour shown, in % of the "
            "brightest white, by the sensor's red, green and blue."
        ),
        table=Table(header=("", "red", "green", "blue", "none"), rows=(*rows, *rest)),
    )
