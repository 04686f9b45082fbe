"""Pictures beside each other, each with its title, rows with a label."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import cv2
import numpy as np

from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.report.figure import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH_IN: Final = 8.4
_LEVELS: Final = 51
"""Of a colour: fewer than a screen shows, which keeps files of noisy pictures small."""


def draw_strip(rows: Mapping[str, Mapping[str, FloatArray]], *, shrink: int = 1) -> "Figure":
    """Draw rows of pictures.

    Args:
        rows: Label -> title -> (3, h, w) linear Rec.709, all of one size; titles may hold a break.
        shrink: Pixels of a picture along a side of one that is drawn, which has their mean.
    """
    columns = max(len(row) for row in rows.values())
    first = next(iter(next(iter(rows.values())).values()))
    side_in = WIDTH_IN / columns
    height_in = side_in * first.shape[1] / first.shape[2] + 0.42
    figure = new_figure(WIDTH_IN, height_in * len(rows))
    panels = figure.subplots(len(rows), columns, squeeze=False)
    for (label, row), line in zip(rows.items(), panels, strict=True):
        for panel in line:
            panel.set_axis_off()
        for number, (panel, (title, picture)) in enumerate(zip(line, row.items(), strict=False)):
            panel.imshow(_shown(picture, shrink), interpolation="nearest")
            panel.set_title(title, fontsize=7)
            if number == 0 and label:
                panel.text(
                    -0.03,
                    0.5,
                    label,
                    fontsize=7,
                    rotation=90,
                    ha="right",
                    va="center",
                    transform=panel.transAxes,
                )
    return figure


def _shown(picture: FloatArray, shrink: int) -> FloatArray:
    """Return (h, w, 3) sRGB values."""
    _, height, width = picture.shape
    size = (max(width // shrink, 1), max(height // shrink, 1))
    small = cv2.resize(
        np.ascontiguousarray(picture.transpose(1, 2, 0)), size, interpolation=cv2.INTER_AREA
    )
    seen = np.clip(encode_srgb(small), 0, 1)
    return np.asarray(np.rint(seen * _LEVELS) / _LEVELS)
