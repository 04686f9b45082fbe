"""Smooth functions as sums of cubic B-splines on even knots.

References: Unser 1999, "Splines: a perfect fit for signal and image processing", eq. (4).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatGrid = NDArray[np.float64]
_REACH: Final = 2.0


def bumps(place: FloatGrid, intervals: int) -> FloatGrid:
    """Return the values (place, intervals + 3) of all B-splines that reach into 0..1."""
    at = place[:, None] * intervals - np.arange(-1, intervals + 2)
    far = np.abs(at)
    near = 2 / 3 - far**2 + far**3 / 2
    tail = np.maximum(_REACH - far, 0) ** 3 / 6
    return np.where(far < 1, near, tail)


def bump_slopes(place: FloatGrid, intervals: int) -> FloatGrid:
    """Return their derivatives."""
    at = place[:, None] * intervals - np.arange(-1, intervals + 2)
    far = np.abs(at)
    near = -2 * far + 1.5 * far**2
    tail = -(np.maximum(_REACH - far, 0) ** 2) / 2
    return np.sign(at) * np.where(far < 1, near, tail) * intervals


class Radial:
    """Functions of the radius that are 0 and even at the centre: splines of its square."""

    def __init__(self, reach: float, intervals: int) -> None:
        """Store the largest radius, and the number of intervals of its square."""
        self._reach, self._intervals = reach, intervals
        self._at_centre = bumps(np.zeros(1), intervals)

    def terms(self, radius: FloatGrid) -> FloatGrid:
        """Return (place, term); all splines together are constant, so one is left out."""
        share = (radius / self._reach) ** 2
        return np.asarray((bumps(share, self._intervals) - self._at_centre)[:, 1:])

    def slopes(self, radius: FloatGrid) -> FloatGrid:
        """Return their derivatives by the radius."""
        share = (radius / self._reach) ** 2
        slope = bump_slopes(share, self._intervals)[:, 1:]
        return np.asarray(slope * (2 * radius / self._reach**2)[:, None])


class Surface:
    """Functions of a place: products of splines over a rectangle."""

    def __init__(self, x: FloatGrid, y: FloatGrid, spacing: float) -> None:
        """Store the knots, from places that it must reach and the distance of its knots."""
        self._low = float(x.min()), float(y.min())
        spans = float(np.ptp(x)), float(np.ptp(y))
        self._counts = tuple(max(1, int(np.ceil(span / spacing))) for span in spans)
        self._spans = tuple(max(span, 1e-9) for span in spans)

    def terms(self, x: FloatGrid, y: FloatGrid) -> FloatGrid:
        """Return (place, term)."""
        along, down = (
            bumps((place - low) / span, count)
            for place, low, span, count in zip(
                (x, y), self._low, self._spans, self._counts, strict=True
            )
        )
        return np.asarray((down[:, :, None] * along[:, None, :]).reshape(len(x), -1))
