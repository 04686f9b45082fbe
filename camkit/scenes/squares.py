"""Dark squares on white, turned by some degrees: a target to measure the focus of a unit on."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.scenes.slanted_edge import bright_share

PITCH_PX: Final = 352
SIDE_PX: Final = 176
"""Of the squares; as wide is the white between them."""
LEVELS: Final = (0.05, 0.6)
ANGLES_DEG: Final = (4.0, 14.0)
_BAND_PX: Final = 256


def squares_scene(seed: int, height: int, width: int) -> FloatArray:
    """Draw squares that fill a picture.

    Args:
        seed: Of the angle by which they are turned, and of where the first one lies.
        height: Rows in pixels.
        width: Columns in pixels.

    Returns:
        (3, height, width) float32, linear Rec.709, grey; a pixel holds the share of its area that
        is white, but for the corners of the squares.

    Raises:
        ContractError: If the size is not positive.
    """
    if min(height, width) < 1:
        raise ContractError(f"squares need a size >= 1; got {width}x{height}")
    rng = np.random.default_rng(seed)
    angle_rad = math.radians(rng.uniform(*ANGLES_DEG)) * rng.choice([-1, 1])
    offset = rng.uniform(0, PITCH_PX, 2)
    plane = np.empty((height, width), np.float32)
    for top in range(0, height, _BAND_PX):
        rows = np.arange(top, min(top + _BAND_PX, height))
        plane[rows] = _rows(rows, width, angle_rad, offset)
    return np.repeat(plane[None], 3, axis=0)


def _rows(
    rows: NDArray[np.intp], width: int, angle_rad: float, offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    y, x = rows[:, None] + offset[0], np.arange(width) + offset[1]
    inside = np.ones((rows.size, width))
    for position in (x * cosine + y * sine, y * cosine - x * sine):
        from_middle = np.abs(position % PITCH_PX - PITCH_PX / 2)
        inside *= bright_share(SIDE_PX / 2 - from_middle, cosine, abs(sine))
    dark, bright = LEVELS
    return bright + (dark - bright) * inside
