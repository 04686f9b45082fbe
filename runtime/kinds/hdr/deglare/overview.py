"""A small picture of the whole, of lights and of what lies between them.

rows -> means of squares of pixels -> how bright, and how much of each square is light
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.arrays import FloatArray

MOST_PX: Final = 768
"""Longer side of an overview, at most."""
ROWS_AT_ONCE: Final = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Overview:
    """A picture in squares of pixels; what is left of a last square is left out.

    Attributes:
        light: (h, w) float32: mean of the colours, each no more than where it clips, 1.0.
        lights: (h, w) float32: share of the pixels that are lights.
        square_px: Side of a square.
    """

    light: FloatArray
    lights: FloatArray
    square_px: int


def overview_of(
    read: Callable[[int, int], FloatArray], height: int, width: int, level: float
) -> Overview:
    """Return the overview of a picture.

    Args:
        read: Gives rows top..bottom, (c, rows, width) float32, every colour clips at 1.
        height: Rows.
        width: Columns.
        level: A pixel is light where a colour reaches this.
    """
    side = max(-(-max(height, width) // MOST_PX), 1)
    rows, columns = height // side, width // side
    light = np.empty((rows, columns), np.float32)
    lights = np.empty((rows, columns), np.float32)
    at_once = max(ROWS_AT_ONCE // side, 1)
    for first in range(0, rows, at_once):
        last = min(first + at_once, rows)
        band = read(first * side, last * side)[..., : columns * side]
        grey = np.minimum(band, 1).mean(axis=0, dtype=np.float32)
        light[first:last] = _squares(grey, side)
        lights[first:last] = _squares((band.max(axis=0) >= level).astype(np.float32), side)
    return Overview(light=light, lights=lights, square_px=side)


def _squares(plane: FloatArray, side: int) -> FloatArray:
    height, width = plane.shape
    cells = plane.reshape(height // side, side, width // side, side)
    return np.asarray(cells.mean(axis=(1, 3), dtype=np.float32))
