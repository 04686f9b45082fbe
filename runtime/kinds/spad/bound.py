"""The Cramer-Rao bound of a time of flight, with amplitude and background unknown as well.

Poisson counts of mean a s_k(mu) + b have the Fisher information sum_k g_k g_k^T / mean_k, g the
derivatives by (mu, a, b). With r = b / a, the bound of mu is 1 / sqrt(a J), J of the shape and r.
"""

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.kinds.spad.bank import Bank


def information(bank: Bank, ratio: float) -> NDArray[np.float64]:
    """Return J of every template, 1/ps^2 per signal photon.

    Args:
        bank: The templates.
        ratio: r, background of a bin over signal photons, > 0.

    Returns:
        (m,) >= 0; 0 where a time of flight cannot be told.
    """
    s, ds, bins = bank.shares, bank.slopes, bank.axis.bins
    rate = s + ratio
    has_share = s > 0
    outside = (bins - has_share.sum(axis=1)) / ratio

    def summed(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.where(has_share, values / rate, 0.0).sum(axis=1))

    tt, ta, tb = summed(ds * ds), summed(ds * s), summed(ds)
    aa, ab = summed(s * s), summed(s)
    bb = summed(np.ones_like(s)) + outside
    # what amplitude and background take away: the Schur complement of their block
    det = aa * bb - ab * ab
    safe = np.where(det > 1e-12 * aa * bb, det, np.inf)
    loss = (ta * ta * bb - 2 * ta * tb * ab + tb * tb * aa) / safe
    return np.asarray(np.maximum(tt - loss, 0.0))
