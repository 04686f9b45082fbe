"""Least squares: the dissertation's way to a time of flight, beside the log-matched bank.

min over a, b, mu of the sum over bins of (n_k - a s_k(mu) - b)^2. With the best a and b put in, mu
is where counts and pulse, both without their means, have the greatest product over the norm of the
pulse. Squares trust a bright bin as much as a dark one; photons do not, so that times scatter more.

References: dissertation, eq. (4.9), with a background beside it.
"""

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.spad.bank import Banded, Bank
from camkit.runtime.kinds.spad.fit import (
    LEAST_RATE,
    Fit,
    Fitter,
    evidence_at,
    in_blocks,
    peak,
    summed_from_left,
)


class LeastSquares:
    """The templates of a bank without their means, made ready for products with counts."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        bank = fitter.bank
        self._values = Banded(bank, np.arange(len(bank.mu_ps)), bank.shares)
        s, bins = bank.shares, bank.axis.bins
        norms = (s * s).sum(axis=1) - s.sum(axis=1) ** 2 / bins
        self._norm = np.sqrt(np.maximum(norms, 1e-12)).astype(np.float32)

    def fit(self, counts: FloatArray) -> Fit:
        """Fit one return to every pixel.

        Args:
            counts: (p, bins) float32, finite and >= 0.

        Returns:
            What was found; evidence is that of the likelihood at the time found here, and sigma
            what least squares scatter by.
        """
        return in_blocks(self._fit_block, counts, self._fitter.bank)

    def _fit_block(self, counts: FloatArray) -> Fit:
        bank = self._fitter.bank
        sums = summed_from_left(counts)
        mean = (sums[:, -1] / bank.axis.bins).astype(np.float32)
        products = self._values.product(counts)
        products -= mean[:, None] * bank.totals.astype(np.float32)
        products /= self._norm
        template, shift, _ = peak(products)
        amplitude, background = self._fitter.split(sums, template)
        return Fit(
            time_of_flight_ps=bank.mu_ps[template] + shift * bank.step_ps,
            amplitude=amplitude,
            background=background,
            sigma_ps=_scatter(bank, template, amplitude, background),
            evidence=evidence_at(bank, counts, template, amplitude, background),
            template=template,
        )


def _scatter(
    bank: Bank,
    template: NDArray[np.int64],
    amplitude: NDArray[np.float64],
    background: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the standard deviation of the times: sum(g^2 mean) / (a sum(g s'))^2 of the slopes g.

    g is s' without what amplitude and background take of it.
    """
    bins = bank.axis.bins
    s, ds = bank.shares[template], bank.slopes[template]
    has_share = s > 0
    mean_s, mean_ds = s.sum(axis=1) / bins, ds.sum(axis=1) / bins
    norm = np.maximum((s * s).sum(axis=1) - bins * mean_s**2, 1e-12)
    part = ((s * ds).sum(axis=1) - bins * mean_s * mean_ds) / norm
    outside = part * mean_s - mean_ds  # g of the bins that the pulse does not reach
    g = np.where(has_share, ds - part[:, None] * s + outside[:, None], 0.0)
    noise = (g * g * (amplitude[:, None] * s + background[:, None])).sum(axis=1)
    noise += (bins - has_share.sum(axis=1)) * outside**2 * background
    steepness = np.maximum(amplitude, LEAST_RATE) * np.maximum((g * ds).sum(axis=1), 1e-12)
    return np.asarray(np.hypot(np.sqrt(noise) / steepness, bank.resolved_ps / np.sqrt(12)))
