"""A pulse of light that sweeps over an object, and over what a mirror shows of it.

A point lamp beside the object sends a pulse: it reaches a place of the object after the way from
the lamp. The mirror stands upright in the middle; what it shows of a place came to the mirror
first, so it is as much later as twice the distance between place and mirror.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS

Floats = NDArray[np.float64]
MIRROR: Final = 0.8
"""Share of light that it reflects."""
CELLS: Final = 6
"""Squares along a side of the board on the object."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """What an array sees.

    Attributes:
        times_ps: (h, w) when the pulse is seen.
        albedo: (h, w) how bright; 0 where nothing is.
    """

    times_ps: Floats
    albedo: Floats


def mirrored(size_px: tuple[int, int], span_ps: tuple[float, float]) -> Sight:
    """Return an object and its mirror image.

    Args:
        size_px: (height, width), of even width.
        span_ps: When the pulse is first and last seen; the object is as large as makes it so.

    Raises:
        ContractError: If the width is odd.
    """
    height, width = size_px
    if width % 2:
        raise ContractError(f"the mirror stands in the middle of an even width; got {width}")
    half = width // 2
    albedo = _object(height, half)
    y, x = np.mgrid[:height, :half]
    lamp_y, lamp_x = 0.85 * height, 0.05 * half
    # in sub-pixels; the mirror is at x = half
    to_place = np.hypot(y - lamp_y, x - lamp_x)
    later = 2.0 * (half - 0.5 - x)
    both = np.concatenate([to_place, (to_place + later)[:, ::-1]], axis=1)
    bright = np.concatenate([albedo, MIRROR * albedo[:, ::-1]], axis=1)
    seen = both[bright > 0]
    share = (both - seen.min()) / (seen.max() - seen.min())
    times = span_ps[0] + share * (span_ps[1] - span_ps[0])
    return Sight(times_ps=times, albedo=bright)


def pixel_mm(sight: Sight) -> float:
    """Return how large a sub-pixel is at the object: what light travels in the time between two."""
    half = sight.times_ps.shape[1] // 2
    # along the mirror's foot, where the way from the lamp grows by one sub-pixel in each
    row = int(0.85 * sight.times_ps.shape[0])
    step_ps = float(np.median(np.diff(sight.times_ps[row, half // 4 : half])))
    return step_ps * LIGHT_M_PER_PS * 1000


def _object(height: int, width: int) -> Floats:
    """Return a vase with a board of squares behind it, (h, w) albedo."""
    y, x = np.mgrid[:height, :width]
    v, u = (y + 0.5) / height, (x + 0.5) / width
    squares = (np.floor(CELLS * u) + np.floor(CELLS * v)) % 2
    board = (np.abs(u - 0.5) < 0.42) & (np.abs(v - 0.5) < 0.42)
    found = np.where(board, 0.15 + 0.2 * squares, 0.0)
    waist = 0.1 + 0.1 * np.sin(np.pi * np.clip((v - 0.2) / 0.6, 0, 1)) ** 2
    vase = (np.abs(u - 0.5) < waist) & (np.abs(v - 0.5) < 0.3)
    bands = 0.75 + 0.25 * np.sign(np.sin(2 * np.pi * 9 * v))
    return np.where(vase, bands, found)
