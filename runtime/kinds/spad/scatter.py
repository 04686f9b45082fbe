"""The growth of the scatter of counts by pile-up correction: by pixel, where its pulse lies.

A rate that a bin had only some cycles left to show, or that is read off a gate which is nearly
always full, scatters more than the Poisson counts it stands for:

    var(N r_k) / (N r_k) = (N / N_k) (exp(r_k) - 1) / r_k

r_k photons of a cycle in bin k, N cycles, N_k those that no earlier bin took (of a gate: N). Time
is told by the slopes of a pulse, so a pixel's growth is the mean over its bins, weighed by what
each tells of the time. Counts divided by it have the variance of Poisson counts again, and fit,
sigma and evidence need no other formula.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.spad.fit import LEAST_SIGNAL, MOST_AT_ONCE, Fitter
from camkit.runtime.kinds.spad.time_axis import Orientation

LEAST_RATE: Final = 1e-6
"""Photons of a cycle, or share of a pulse: less is no number to divide by."""
TINY: Final = 1e-300


def growth_of_bins(
    counts: FloatArray, cycles: int, orientation: Orientation
) -> NDArray[np.float64]:
    """Return variance over mean of every bin, (p, bins) >= 1.

    Args:
        counts: (p, bins) as `without_pile_up` gives them.
        cycles: As it was given.
        orientation: Of the time axis.
    """
    rates = np.maximum(counts / float(cycles), LEAST_RATE)
    growth = np.expm1(rates) / rates
    if orientation == "histogram":
        growth[:, 1:] *= np.exp(np.cumsum(counts[:, :-1] / float(cycles), axis=1))
    return np.asarray(growth)


def growth(fitter: Fitter, counts: FloatArray, cycles: int) -> NDArray[np.float64]:
    """Return variance over mean of every pixel, (p,) >= 1.

    Args:
        fitter: Of the pulse.
        counts: (p, bins) as `without_pile_up` gives them.
        cycles: As it was given.
    """
    parts = [
        _growth(fitter, counts[start : start + MOST_AT_ONCE], cycles)
        for start in range(0, max(len(counts), 1), MOST_AT_ONCE)
    ]
    return np.concatenate(parts)


def _growth(fitter: Fitter, counts: FloatArray, cycles: int) -> NDArray[np.float64]:
    bank, fit = fitter.bank, fitter.fit(counts)
    ratio = fit.background / np.maximum(fit.amplitude, LEAST_SIGNAL)
    rate = np.maximum(bank.shares[fit.template] + ratio[:, None], LEAST_RATE)
    information = bank.slopes[fit.template] ** 2 / rate
    of_bins = growth_of_bins(counts, cycles, bank.axis.orientation)
    near = np.take_along_axis(of_bins, bank.bins[fit.template], axis=1)
    return np.asarray((information * near).sum(axis=1) / np.maximum(information.sum(axis=1), TINY))
