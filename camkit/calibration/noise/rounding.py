"""Noise as a converter with steps shows it, and what can be said of it afterwards.

Rounding adds 1/12 of a squared step to a variance, as long as the noise is wide enough to smear the
steps. Finer noise shows a variance between two bounds: least where the level lies on a step, most
where it lies between two. Where these bounds leave the noise open, it is only known to lie below
the greater one, and never below what EMVA 1288 asks for: 0.40 steps.

References: EMVA 1288 release 4.0, ch. 6.6 and C.4; Widrow 1956 (rounding as noise).
"""

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

OF_ROUNDING: Final = 1 / 12
LEAST_BOUND: Final = 0.40
"""In steps: with less, no variance in the dark tells the noise (EMVA 1288)."""
MOST_OPEN: Final = 0.05
"""Of the noise, by which its bounds may lie from it."""
_WIDEST: Final = 1.5
_CODES: Final = 12
_SIGMAS: Final = 600
_TAIL: Final = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """A standard deviation, in DN.

    Attributes:
        value: The noise, or what it lies below.
        resolved: Whether it is the noise.
    """

    value: float
    resolved: bool


def spread_of(variance: float, samples: int, step: float) -> Spread:
    """Return the noise before the converter.

    Args:
        variance: Of rounded noise, in DN^2.
        samples: Behind it.
        step: Of the converter, in DN.
    """
    rounded = variance / step**2
    least, most = _bounds(rounded)
    plain = float(np.sqrt(max(rounded - OF_ROUNDING, 0)))
    if max(most - plain, plain - least) <= MOST_OPEN * plain:
        return Spread(value=plain * step, resolved=True)
    chance = _TAIL * float(np.sqrt((rounded + 2 * rounded**2) / samples)) + _TAIL / samples
    return Spread(value=max(_bounds(rounded + chance)[1], LEAST_BOUND) * step, resolved=False)


def rounded_variance(sigma: float, place: float) -> float:
    """Return the variance of Gaussian noise after rounding to whole numbers.

    Args:
        sigma: Its standard deviation, at most `_WIDEST`.
        place: Its mean.
    """
    codes = np.arange(-_CODES, _CODES + 1)
    share = ndtr((codes + 0.5 - place) / sigma) - ndtr((codes - 0.5 - place) / sigma)
    mean = float(share @ codes)
    return float(share @ (codes - mean) ** 2)


def _bounds(variance: float) -> tuple[float, float]:
    """Return least and most noise, in steps, that a variance in squared steps may stand for."""
    sigma, on_step, half_step = _table()
    if variance >= on_step[-1]:
        plain = float(np.sqrt(variance - OF_ROUNDING))
        return plain, plain
    least = 0.0 if variance < half_step[0] else float(np.interp(variance, half_step, sigma))
    return least, float(np.interp(variance, on_step, sigma))


@cache
def _table() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    sigma = np.linspace(0.02, _WIDEST, _SIGMAS)
    on_step, half_step = (
        np.array([rounded_variance(float(s), place) for s in sigma]) for place in (0.0, 0.5)
    )
    return sigma, on_step, half_step
