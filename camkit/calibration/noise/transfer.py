"""The line of photon transfer: the variance of the signal over its mean.

    variance = dark + K signal,    gain in electrons per DN = 1 / K

Variances are known to a share of themselves, 2 / samples in square, which weighs the points.

References: EMVA 1288 release 4.0, eq. (15); Janesick 2007, ch. 5.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import DecodeError

_ROUNDS: Final = 4
_LEAST_LEVELS: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A level of light.

    Attributes:
        signal: In DN above the dark.
        variance: In DN^2.
        samples: Behind the variance.
    """

    signal: float
    variance: float
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """A line through the points of one colour.

    Attributes:
        dn_per_e: Its slope K.
        error: Standard deviation of the slope.
        dark_variance: Where it begins, in DN^2.
        points: What it was fitted to.
    """

    dn_per_e: float
    error: float
    dark_variance: float
    points: tuple[Point, ...]

    def variance_at(self, signal: float) -> float:
        """Return the variance of the line at a signal in DN."""
        return self.dark_variance + self.dn_per_e * signal

    def misfits(self) -> NDArray[np.float64]:
        """Return the deviation of every point, as a share of the line."""
        return np.array([p.variance / self.variance_at(p.signal) - 1 for p in self.points])


def fit_transfer(points: Sequence[Point], dark: Point) -> Transfer:
    """Fit the line of one colour.

    Args:
        points: Two or more levels of light.
        dark: Variance in the dark, its signal 0.

    Raises:
        DecodeError: If the variance does not grow with the light.
    """
    levels = [dark, *points]
    signal, variance, samples = (
        np.array([getattr(p, name) for p in levels], dtype=np.float64)
        for name in ("signal", "variance", "samples")
    )
    terms = np.stack([np.ones_like(signal), signal], axis=1)
    expected = np.maximum(variance, 1e-12)
    begins, slope, spread = 0.0, 0.0, np.zeros((2, 2))
    for _ in range(_ROUNDS):
        weight = samples / (2 * expected**2)
        spread = np.linalg.pinv(terms.T @ (weight[:, None] * terms))
        begins, slope = spread @ (terms.T @ (weight * variance))
        if not slope > 0:
            raise DecodeError(
                "the noise does not grow with the light: give pairs of flats at levels that "
                "differ, straight from the sensor"
            )
        expected = np.maximum(begins + slope * signal, expected.min())
    freedom = len(levels) - _LEAST_LEVELS
    chi = float(((variance - expected) ** 2 * samples / (2 * expected**2)).sum())
    scatter = max(1.0, chi / freedom) if freedom > 0 else 1.0
    return Transfer(
        dn_per_e=float(slope),
        error=float(np.sqrt(spread[1, 1] * scatter)),
        dark_variance=float(begins),
        points=tuple(points),
    )
