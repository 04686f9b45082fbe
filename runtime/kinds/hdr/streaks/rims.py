"""Colours at the rims of lights: a lamp's own within it, those of the scene beside it.

    lit pixels hardly above white -> as bright in every colour as their lamp's colour asks for
    pixels beside clipped samples -> the colour of what lies around; their brightness stays

Every colour clips at a level of its own, so light that is only known to exceed all of them has the
tint of the sensor, pink mostly. And a demosaic beside clipped samples mixes them in, one colour
more than the other.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.shapes import widened

PALE: Final = 0.3
"""Of white and of a lamp's mean, added to the colour of the lamp: faint ones are nearly white."""
MOST_RAISED: Final = 2.0
"""A colour is raised to this many times itself."""
MIXED_PX: Final = 2
"""A demosaic mixes a clipped sample in so far along its row or column, and one pixel across."""
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
    raised = np.minimum(hue * least, np.float32(MOST_RAISED) * np.maximum(light, levels))
    return np.where(lit, np.maximum(light, raised), light)


def near_clipped(clipped: Mask) -> Mask:
    """Return a mask of the pixels (h, w) near clipped samples, into which lights are painted."""
    return widened(clipped, LIT_PX, LIT_PX)


def no_brighter(lit: FloatArray, captured: FloatArray, near: Mask) -> None:
    """Darken a picture (3, h, w) in place to hardly brighter than it was seen, away from lights.

    Networks act where it is brighter, and are left out where no sample clipped.

    Args:
        lit: With lights, without streaks.
        captured: As captured.
        near: (h, w) of `near_clipped`.
    """
    far: Mask | bool = ~near if near.any() else True
    for plane, original in zip(lit, captured, strict=True):
        most = np.maximum(original, 0)
        most *= np.float32(MOST_OVER)
        np.minimum(plane, most, out=plane, where=far)


def colour_by_surroundings(planes: FloatArray, clipped: Mask, lit: Mask) -> None:
    """Paint pixels beside clipped samples in the colour of what lies around, in place.

    Args:
        planes: (3, h, w) balanced, before lights are put in; rows within `MARGIN_PX` of a cut are
            of no use.
        clipped: (h, w): whose own sample clipped.
        lit: (h, w): which lights are put into.
    """
    mixed = widened(clipped, MIXED_PX, 1) | widened(clipped, 1, MIXED_PX)
    rows, columns = np.nonzero(mixed & ~clipped & ~lit)
    colours = planes[:, rows, columns]
    sums = np.zeros_like(colours)
    unmixed = np.pad(~mixed, AROUND_PX)
    flat, places = planes.reshape(len(planes), -1), rows * planes.shape[2] + columns
    for down, right in np.ndindex(2 * AROUND_PX + 1, 2 * AROUND_PX + 1):
        y, x = down - AROUND_PX, right - AROUND_PX
        weight = np.float32(np.exp(-0.5 * (y**2 + x**2) / SIGMA_PX**2))
        weights = weight * unmixed[rows + down, columns + right]
        # what lies outside has no weight, whatever stands in its place
        there = flat.take(places + (y * planes.shape[2] + x), axis=1, mode="clip")
        sums += weights * np.maximum(there, 0, out=there)
    whole, bright = sums.sum(axis=0), np.maximum(colours, 0).sum(axis=0)
    coloured = sums / np.maximum(whole, _TINY) * bright
    planes[:, rows, columns] = np.where(whole > _TINY, coloured, colours)
