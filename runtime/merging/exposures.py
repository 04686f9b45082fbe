"""Exposures that differ from the times that frames state, told from the frames themselves.

A shutter that is off, a lamp that dims or dusk that falls makes one frame brighter than its time
says, which merged light then takes for the truth. Of frames that follow each other by time, the
ratio of light under the response is compared with that of the times. A share of the ratio that all
pairs have in common is left to the response, which it cannot be told from; only what stands out
from the spread of the pairs is taken off, and never more than a fifth.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.merging.response import FloatTable, Response

LEAST_PAIRS: Final = 4
"""Of frames that share light, without which nothing stands out."""
_INSIDE: Final = (20, 235)
"""Codes that are sure: neither dark nor near white."""
_LEAST_SAMPLES: Final = 400
_LEAST_EXCESS: Final = 0.03
_SPREADS: Final = 2.0
_MOST_EXCESS: Final = 0.2
_LEAST_STEP: Final = 0.05
_MAD_TO_SIGMA: Final = 1.4826


def exposure_factors(
    codes: NDArray[np.uint8], times_s: NDArray[np.float64], response: Response
) -> FloatTable:
    """Return by what each stated time is to be multiplied; 1 where nothing stands out.

    Args:
        codes: (frame, channel, pixel) uint8, the longest frame first.
        times_s: (frame,) exposure times as stated.
        response: Of the codes.
    """
    steps = np.log(times_s[:-1] / times_s[1:])
    ratios = [_ratio(codes[n], codes[n + 1], response) for n in range(steps.size)]
    usable = np.isfinite(ratios) & (steps > _LEAST_STEP)
    if np.count_nonzero(usable) < LEAST_PAIRS:
        return np.ones(times_s.size)
    excess = np.where(usable, ratios, steps) - steps
    excess -= np.where(usable, steps * np.median(excess[usable] / steps[usable]), 0)
    limit = max(_LEAST_EXCESS, _SPREADS * _MAD_TO_SIGMA * float(np.median(np.abs(excess[usable]))))
    surplus = np.clip(np.abs(excess) - limit, 0, _MOST_EXCESS) * np.sign(excess)
    logs = np.append(np.cumsum(surplus[::-1])[::-1], 0.0)
    return np.asarray(np.exp(logs - np.median(logs)))


def _ratio(longer: NDArray[np.uint8], shorter: NDArray[np.uint8], response: Response) -> float:
    """Return the logarithm of the ratio of light of two frames; NaN where they share too little."""
    low, high = _INSIDE
    inside = (longer >= low) & (longer <= high) & (shorter >= low) & (shorter <= high)
    if np.count_nonzero(inside) < _LEAST_SAMPLES:
        return float("nan")
    differences = [
        table[one[both]] - table[other[both]]
        for table, one, other, both in zip(response.log_light, longer, shorter, inside, strict=True)
    ]
    return float(np.median(np.concatenate(differences)))
