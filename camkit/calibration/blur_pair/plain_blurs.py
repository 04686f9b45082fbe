"""Transfer functions of blurs that know no lens: a Gaussian and an even disc."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1

from camkit.calibration.blur_pair.pair_grid import PairGrid

FloatGrid = NDArray[np.float64]


def gaussian_transfer(grid: PairGrid, sigma_px: float) -> FloatGrid:
    """Return the transfer (1, n, n // 2 + 1) of a Gaussian of a standard deviation."""
    down, across = grid.frequencies
    return np.asarray(np.exp(-2 * (np.pi * sigma_px) ** 2 * (down**2 + across**2))[None])


def disc_transfer(grid: PairGrid, diameter_px: float) -> FloatGrid:
    """Return the transfer (1, n, n // 2 + 1) of an even disc of a diameter.

    References: Goodman 2005, Introduction to Fourier Optics, eq. (2-35): 2 J1(x) / x.
    """
    down, across = grid.frequencies
    x = np.pi * diameter_px * np.hypot(down, across)
    safe = np.where(x == 0, 1.0, x)
    return np.asarray(np.where(x == 0, 1.0, 2 * j1(safe) / safe)[None])
