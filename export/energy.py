"""Figures of a PSF for the card: encircled energy and modulation."""

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError


def energy_diameter_px(kernel: FloatArray, share: float) -> float:
    """Return the diameter of the circle about the centroid that holds a share of the energy.

    Args:
        kernel: (h, w), sums to 1.
        share: In 0..1.

    Raises:
        ContractError: If the share lies outside 0..1.
    """
    if not 0 < share < 1:
        raise ContractError(f"the share of the energy must lie in 0..1; got {share}")
    y, x = np.indices(kernel.shape)
    total = float(kernel.sum())
    cy, cx = float((y * kernel).sum()) / total, float((x * kernel).sum()) / total
    radius = np.hypot(y - cy, x - cx).ravel()
    order = np.argsort(radius)
    enclosed = np.cumsum(kernel.ravel()[order]) / total
    return float(2 * radius[order][np.searchsorted(enclosed, share)])


def modulation(kernel: FloatArray, cycles_per_px: float) -> float:
    """Return |OTF| of a (h, w) kernel at a frequency, averaged over both axes."""
    h, w = kernel.shape
    down = np.exp(-2j * np.pi * cycles_per_px * np.arange(h))
    across = np.exp(-2j * np.pi * cycles_per_px * np.arange(w))
    return float((abs(kernel.sum(axis=1) @ down) + abs(kernel.sum(axis=0) @ across)) / 2)
