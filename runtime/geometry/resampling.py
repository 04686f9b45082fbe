"""Samples of a plane between its pixels, with and without the rings of kernels beside lamps.

Cubic and Lanczos kernels have negative lobes: a lamp of 200 times white takes up to 20 times white
from the pixels beside it. So values there are limited to the range of the samples that they are
made of, and so is what falls below black. Everywhere else the kernel's value stays, since its
overshoot is what makes detail sharp (docs/decisions: no rings around lamps).
"""

from collections.abc import Mapping
from itertools import product
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages.undistort import Interpolation

Places = NDArray[np.int16]
"""(h, w, 2) columns and rows of samples."""
Maps = tuple[Places, object]
"""Of cv2: places of the upper left of the four middle samples, and the fractions beyond them."""

FLAGS: Final[Mapping[Interpolation, int]] = {
    "lanczos": cv2.INTER_LANCZOS4,
    "cubic": cv2.INTER_CUBIC,
}
SIDES_PX: Final[Mapping[Interpolation, int]] = {"lanczos": 8, "cubic": 4}
"""Side of the square of samples that a value is made of."""
WHITE: Final = 1.0
FLOOR: Final = -0.02
"""Values below it are limited wherever they are; noise around black rarely goes so far."""


def resampled(
    plane: FloatArray,
    maps: Maps,
    *,
    interpolation: Interpolation = "lanczos",
    border: int = cv2.BORDER_REPLICATE,
) -> FloatArray:
    """Return a plane at places between its pixels.

    Args:
        plane: (h, w) float32.
        maps: Where.
        interpolation: Kernel.
        border: What cv2 takes for samples beyond the plane.
    """
    whole, fraction = maps
    flag = FLAGS[interpolation]
    out = cv2.remap(np.ascontiguousarray(plane), whole, fraction, flag, borderMode=border)
    return np.asarray(out, dtype=np.float32)


def resampled_limited(
    plane: FloatArray, maps: Maps, *, interpolation: Interpolation = "lanczos"
) -> FloatArray:
    """Return a plane at places between its pixels, without rings around lamps.

    A value stays within the range of its samples where some of them are brighter than white and
    others are not, and where it would lie below `FLOOR`.

    Args:
        plane: (h, w) float32 rows that hold all samples, or end where the picture does, which goes
            on as its border.
        maps: Where.
        interpolation: Kernel.
    """
    out = resampled(plane, maps, interpolation=interpolation)
    side, places = SIDES_PX[interpolation], maps[0]
    anchor_px = side // 2 - 1
    wrong = out < FLOOR
    if plane.max() > WHITE:
        square = np.ones((side, side), np.uint8)
        lit = (plane > WHITE).view(np.uint8)
        rim = cv2.morphologyEx(lit, cv2.MORPH_GRADIENT, square, anchor=(anchor_px, anchor_px))
        near = cv2.remap(rim, places, None, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
        wrong |= near.view(np.bool_)
    at = np.flatnonzero(wrong)
    low, high = _range(plane, places.reshape(-1, 2)[at].astype(np.intp) - anchor_px, side)
    values = out.reshape(-1)
    values[at] = np.clip(values[at], low, high)
    return out


def _range(
    plane: FloatArray, corners: NDArray[np.intp], side: int
) -> tuple[FloatArray, FloatArray]:
    """Return the least and the largest sample of squares; the border holds beyond the plane.

    Args:
        plane: (h, w).
        corners: (n, 2) column and row of the first sample of each.
        side: Of a square.
    """
    height, width = plane.shape
    columns, rows = (
        [(corners[:, axis] + step).clip(0, count - 1) for step in range(side)]
        for axis, count in ((0, width), (1, height))
    )
    low = np.full(len(corners), np.inf, np.float32)
    high = -low
    for row, column in product(rows, columns):
        samples = plane.take(row * width + column)
        np.minimum(low, samples, out=low)
        np.maximum(high, samples, out=high)
    return low, high
