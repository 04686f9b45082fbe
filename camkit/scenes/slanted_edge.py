"""A sharp slanted edge: what the MTF of a camera is measured on.

A pixel holds the share of its area that lies on the bright side, in closed form.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError

FloatGrid = NDArray[np.float64]

LEVELS: Final = (0.15, 0.6)
ANGLE_RAD: Final = math.atan(0.0618)
"""3.5 degrees: no simple fraction, so that rows show many positions within a pixel."""
_UPRIGHT: Final = 1e-9


def slanted_edge(
    height: int,
    width: int,
    *,
    angle_rad: float = ANGLE_RAD,
    along_columns: bool = True,
    levels: tuple[float, float] = LEVELS,
) -> FloatArray:
    """Draw an edge through the middle of a picture.

    Args:
        height: Rows in pixels.
        width: Columns in pixels.
        angle_rad: From the axis along which it runs, in (-pi/2, pi/2); > 0 where it moves to
            larger x with y, or to larger y with x.
        along_columns: Whether it runs near the vertical; else near the horizontal.
        levels: Left (or above) and right (or below).

    Returns:
        (3, height, width) float32, linear Rec.709, grey.

    Raises:
        ContractError: If the size is not positive, the angle not in its range or a level negative.
    """
    if min(height, width) < 1 or not abs(angle_rad) < math.pi / 2 or not min(levels) >= 0:
        raise ContractError(
            "an edge needs a size >= 1, an angle in (-pi/2, pi/2) and levels >= 0; got "
            f"{width}x{height}, {angle_rad:g}, {levels}"
        )
    if not along_columns:
        upright = slanted_edge(width, height, angle_rad=angle_rad, levels=levels)
        return np.ascontiguousarray(upright.transpose(0, 2, 1))
    y, x = np.mgrid[:height, :width] - np.array([height - 1, width - 1])[:, None, None] / 2
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    share = bright_share(x * cosine - y * sine, cosine, abs(sine))
    low, high = levels
    plane = (low + (high - low) * share).astype(np.float32)
    return np.repeat(plane[None], 3, axis=0)


def bright_share(distance: FloatGrid, wide: float, narrow: float) -> FloatGrid:
    """Return the share of pixels' area beyond a line.

    Seen along the line a square is a trapezoid: a box as wide as one side looks, smeared by a box
    as wide as the other does.

    Args:
        distance: Of the middles of the pixels from the line, > 0 beyond it.
        wide: Width of one box, > 0.
        narrow: Of the other, >= 0.
    """
    if narrow < _UPRIGHT:
        return np.clip(distance / wide + 0.5, 0, 1)
    outer, inner = (wide + narrow) / 2, (wide - narrow) / 2
    rise = _ramp(distance + outer) - _ramp(distance + inner)
    fall = _ramp(distance - inner) - _ramp(distance - outer)
    return np.clip((rise - fall) / (wide * narrow), 0, 1)


def _ramp(x: FloatGrid) -> FloatGrid:
    return np.square(np.maximum(x, 0)) / 2
