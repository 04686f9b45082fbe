"""Colours at the rims of lights: a lamp's own within it, those of the scene beside it.

    lit pixels hardly above white -> as bright in every colour as their lamp's colour asks for
    pixels beside clipped samples -> the colour of what lies around; their brightness stays

Every colour clips at a level of its own, so light that is only known to exceed all of them has the
tint of the sensor, pink mostly. And a demosaic beside clipped samples mixes them in, one colour
more than the other.
"""

from typing import Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.contracts import FloatArray

PALE: Final = 0.3
"""Of white and of a lamp's mean, added to the colour of the lamp: faint ones are nearly white."""
MOST_RAISED: Final = 2.0
"""A colour is raised to this many times itself."""
MIXED_PX2: Final = 5
"""Squared distance from a clipped sample within which a demosaic mixes it in."""
LIT_PX: Final = 3
"""Along rows and columns: so far from clipped samples light may be put in and colours change."""
MOST_OVER: Final = 1.15
"""Times what was seen: veil and streaks are taken away, and the core is made the whole."""
AROUND_PX: Final = 4
"""Reach of what lies around a pixel."""
SIGMA_PX: Final = 2.0
MARGIN_PX: Final = AROUND_PX + 2
_TINY: Final = 1e-6
Mask = NDArray[np.bool_]


def in_own_colours(
    light: FloatArray, lit: Mask, excess: FloatArray, levels: FloatArray
) -> FloatArray:
    """Return lit pixels raised to the colour of their lamp.

    Args:
        light: (3, n), multiplied by the gains.
        lit: (3, n): which colours clipped.
        excess: (3, n): what their lamp exceeds white by, mean over its pixels, likewise multiplied.
        levels: (3, 1): where each colour clips.
    """
    hue = excess + np.float32(PALE) * (1 + excess.mean(axis=0))
    hue /= hue.sum(axis=0)
    least = np.where(lit, levels / hue, 0).max(axis=0)
    wanted = np.minimum(hue * least, np.float32(MOST_RAISED) * np.maximum(light, levels))
    return np.where(lit, np.maximum(light, wanted), light)


def near_clipped(clipped: Mask) -> Mask:
    """Return which pixels (h, w) are so near to clipped samples that lights are put into them."""
    square = np.ones((2 * LIT_PX + 1, 1), np.bool_)
    return np.asarray(
        scipy.ndimage.binary_dilation(scipy.ndimage.binary_dilation(clipped, square), square.T)
    )


def no_brighter(lit: FloatArray, seen: FloatArray, near: Mask) -> FloatArray:
    """Return a picture (3, h, w) that is hardly brighter than it was seen, away from lights.

    Networks act where it is brighter, and are left out where no sample clipped.

    Args:
        lit: With lights, without streaks.
        seen: As captured.
        near: (h, w) of `near_clipped`.
    """
    most = np.float32(MOST_OVER) * np.maximum(seen, 0)
    return np.where(near, lit, np.minimum(lit, most))


def coloured_by_surroundings(planes: FloatArray, clipped: Mask, lit: Mask) -> FloatArray:
    """Return a picture whose pixels beside clipped samples have the colour of what lies around.

    Args:
        planes: (3, h, w) balanced, before lights are put in; rows within `MARGIN_PX` of a cut are
            of no use.
        clipped: (h, w): whose own sample clipped.
        lit: (h, w): which lights are put into.
    """
    reach = int(MIXED_PX2**0.5)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    mixed = scipy.ndimage.binary_dilation(clipped, y**2 + x**2 <= MIXED_PX2)
    rows, columns = np.nonzero(mixed & ~clipped & ~lit)
    own = planes[:, rows, columns]
    sums = np.zeros_like(own)
    wide = np.pad(np.maximum(planes, 0), ((0, 0), *[(AROUND_PX, AROUND_PX)] * 2))
    known = np.pad(~mixed, AROUND_PX)
    for down, right in np.ndindex(2 * AROUND_PX + 1, 2 * AROUND_PX + 1):
        there = rows + down, columns + right
        far = (down - AROUND_PX) ** 2 + (right - AROUND_PX) ** 2
        weight = np.float32(np.exp(-0.5 * far / SIGMA_PX**2)) * known[there]
        sums += weight * wide[:, *there]
    whole, bright = sums.sum(axis=0), np.maximum(own, 0).sum(axis=0)
    out = planes.copy()
    coloured = sums / np.maximum(whole, _TINY) * bright
    out[:, rows, columns] = np.where(whole > _TINY, coloured, own)
    return out
