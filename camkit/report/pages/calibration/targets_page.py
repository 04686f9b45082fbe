"""The page of what a display shows: every target in its order, small, and what it is for."""

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from camkit.calibration.display.targets import Codes, Target, Targets
from camkit.report.figure import Figure, chart, new_figure, to_png
from camkit.report.pages.page import Page, Picture, Section, Table, to_html

SMALL_PX: Final = 320
"""Longest side of a target on the page."""
COLUMNS: Final = 4
PER_SHEET: Final = 24
LONGEST: Final = 28
"""Characters of a name above its target."""
_USES: Final = (
    ("board", "camkit calibrate geometry"),
    ("grey", "camkit calibrate tone; the brightest also flat"),
    ("colour", "camkit calibrate pairs, all of them or none"),
    ("picture", "camkit calibrate pairs"),
)


def shrunk(codes: Codes) -> Codes:
    """Return a target (h, w, 3) as small as the page shows it."""
    height, width = codes.shape[:2]
    ratio = min(1.0, SMALL_PX / max(height, width))
    size = max(1, round(ratio * width)), max(1, round(ratio * height))
    return np.asarray(cv2.resize(codes, size, interpolation=cv2.INTER_AREA), np.uint8)


def targets_html(planned: Targets, small: Sequence[Codes]) -> str:
    """Return the page.

    Args:
        planned: What is shown.
        small: Every target, by `shrunk`.
    """
    screen = planned.screen
    instruction = (
        f"Show every PNG on the whole screen, one to one: {screen.width_px} x {screen.height_px} "
        "px. Boards from 3 places at least; grey steps, colours and pictures from one, at one "
        "setting of the camera, the room dark."
    )
    rows = [
        (target.file, _what(planned, target), "-" if target.code is None else str(target.code))
        for target in planned.targets
    ]
    pictures = [
        Picture(
            f"Targets {first + 1} to {min(first + PER_SHEET, len(small))}.",
            to_png(draw_sheet(planned.targets[first : first + PER_SHEET], small[first:])),
        )
        for first in range(0, len(small), PER_SHEET)
    ]
    uses = Table(header=("kind", "for"), rows=_USES)
    order = Table(header=("file", "what", "number of its marks"), rows=rows)
    sections = [
        Section("What to photograph", (instruction, uses)),
        Section("In this order", (order, *pictures)),
    ]
    return to_html(Page(title="What is shown to the camera", sections=sections))


@chart
def draw_sheet(targets: Sequence[Target], small: Sequence[Codes]) -> Figure:
    """Draw targets side by side, each with the name of its file."""
    rows = -(-len(targets) // COLUMNS)
    figure = new_figure(8.0, 1.7 * rows)
    figure.patch.set_facecolor("#eeeeee")  # white targets have an edge then
    panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for panel in panels:
        panel.axis("off")
    for panel, target, codes in zip(panels, targets, small, strict=False):
        panel.imshow(codes, interpolation="nearest")
        name = target.file
        panel.set_title(name if len(name) <= LONGEST else f"{name[:LONGEST]}...", fontsize=6)
    return figure


def _what(planned: Targets, target: Target) -> str:
    if target.kind == "board":
        return f"board of {planned.board} inner corners, squares of {target.square_px} px"
    if target.source is not None:
        name, space = target.source
        return f"{name}, {space}"
    rgb = target.rgb or (0, 0, 0)
    return f"grey {rgb[0]}" if target.kind == "grey" else f"colour {', '.join(map(str, rgb))}"
