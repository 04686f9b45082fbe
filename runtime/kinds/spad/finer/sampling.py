"""The kernel of a pixel on the fine grid.

plate      the kernel of the bundle's optics
low_fill   nothing: a point
full_fill  all sub-pixels of the pixel: their mean, and scale^2 times the light of one
gaussian   a diffuser

References: Sun 2021, section 4.4.
"""

import math
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.stages import SuperResolve
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.finer.linear import Grid

GAUSSIAN_PIXELS: Final = math.sqrt(3 * math.log(2)) / math.pi
"""Sigma of the least-squares fit to the ideal low pass: 0.459 pixels."""


def sampling_kernel(stage: SuperResolve, plate: FloatArray, grid: Grid) -> FloatArray:
    """Return the kernel (n, n) of a stage's sampling, of the size of the plate's.

    Args:
        stage: Says what its pixels see through.
        plate: (n, n), n odd: the kernel of the optics.
        grid: Where a pixel sees.
    """
    side = plate.shape[0]
    if stage.sampling == "low_fill":
        return point_kernel(side)
    if stage.sampling == "full_fill":
        return box_kernel(side, grid)
    if stage.sampling == "gaussian":
        assert stage.sigma is not None  # its entry says so
        return gaussian_kernel(side, stage.sigma)
    return plate


def light_of(stage: SuperResolve, grid: Grid) -> float:
    """Return how many times the light of one sub-pixel a pixel collects."""
    return float(grid.scale**2) if stage.sampling == "full_fill" else 1.0


def point_kernel(side: int) -> FloatArray:
    """Return the kernel (side, side) of no plate at all."""
    kernel = np.zeros((side, side), np.float32)
    kernel[side // 2, side // 2] = 1
    return kernel


def box_kernel(side: int, grid: Grid) -> FloatArray:
    """Return the kernel (side, side) whose sample at a phase is the mean of the pixel.

    Raises:
        ContractError: If a pixel does not fit in.
    """
    first = side // 2 + grid.phase - (grid.scale - 1)
    if first < 0 or first + grid.scale > side:
        raise ContractError(f"a pixel of {grid.scale} sub-pixels does not fit a kernel of {side}")
    kernel = np.zeros((side, side), np.float32)
    kernel[first : first + grid.scale, first : first + grid.scale] = 1 / grid.scale**2
    return kernel


def gaussian_kernel(side: int, sigma: float) -> FloatArray:
    """Return a Gaussian (side, side) of unit sum; sigma in sub-pixels.

    Raises:
        ContractError: If sigma is not a number > 0.
    """
    if not (math.isfinite(sigma) and sigma > 0):
        raise ContractError(f"the sigma of a Gaussian must be a number > 0; got {sigma}")
    line = np.exp(-0.5 * (np.arange(-(side // 2), side // 2 + 1) / sigma) ** 2)
    kernel = np.outer(line, line)
    return np.asarray(kernel / kernel.sum(), dtype=np.float32)
