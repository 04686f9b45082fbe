"""Kernels of a plate that is not as its bundle says.

    turned, moved   the dots lie elsewhere
    blurred         they are discs: the sensor is out of focus
    etched          all depths are off by one factor: light in other orders of the heights
    opened          the pixels' round areas are larger or smaller than was taken for granted

Positions are (y, x) in sub-pixels. What lies between sub-pixels is shared among the 16 around it,
which is what a pixel sees of a picture with cubic curves between its sub-pixels: sum, middle and
width stay what they are. A scene of points, each in the middle of a sub-pixel, would suffer more:
dots that are turned away from the round areas would be lost (`tools/spad/plate_check.py` at
2a55aa66).
"""

import itertools
import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import convolve

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.report.kinds.spad.bicubic import REACH, cubic
from camkit.runtime.kinds.spad.finer.sampling import point_kernel

Floats = NDArray[np.float64]
DISC_POINTS: Final = 81
"""Along the diameter of a disc."""
TINY: Final = 1e-9


def turned(kernel: FloatArray, angle_rad: float) -> FloatArray:
    """Rotate a kernel (n, n) about its middle, from +x towards +y; it may become larger."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    y, x = _places(kernel)
    return _shared(np.stack([c * y + s * x, c * x - s * y]), kernel)


def shift_kernel(kernel: FloatArray, shift: float) -> FloatArray:
    """Move a kernel (n, n) along both axes; it may become larger."""
    return _shared(_places(kernel) + shift, kernel)


def blurred(kernel: FloatArray, diameter: float) -> FloatArray:
    """Make every dot a disc of even light, `diameter` sub-pixels wide."""
    if diameter <= 0:
        return kernel
    line = (np.arange(DISC_POINTS) + 0.5) / DISC_POINTS - 0.5
    y, x = (diameter * axis.ravel() for axis in np.meshgrid(line, line, indexing="ij"))
    inside = np.hypot(y, x) <= diameter / 2
    places = np.stack([y[inside], x[inside]])
    disc = _shared(places, np.full(places.shape[1], 1 / places.shape[1]))
    return np.asarray(convolve(kernel.astype(np.float64), disc), np.float32)


def order_shares(levels: int, depth_error: float) -> Floats:
    """Return the light in the orders 0, 1, ... of heights in equal levels, (levels,), of sum 1.

    A plate of phase phi, etched (1 + e) times too deep, is exp(i (1 + e) phi). With N levels, each
    as frequent as any other, it is the sum over m of c_m exp(i m phi),

        |c_m|^2 = (sin(pi a) / (N sin(pi a / N)))^2,  a = 1 + e - m

    Order 1 is the plate as designed, order 0 light that passes as if there were none.

    References: Goodman & Silvestri 1970, quantised phase as a sum of its harmonics.
    """
    if levels < 2:
        raise ContractError(f"a plate has at least 2 levels; got {levels}")
    a = 1 + depth_error - np.arange(levels)
    denominator = levels * np.sin(np.pi * a / levels)
    whole = np.abs(denominator) < TINY
    shares = np.square(np.sin(np.pi * a) / np.where(whole, 1.0, denominator))
    return np.asarray(np.where(whole, 1.0, shares))


def etched(kernel: FloatArray, levels: int, depth_error: float) -> FloatArray:
    """Return what a plate etched too deep or too flat makes of its kernel (n, n) of sum 1.

    Order 1 is the kernel, order 0 a point. The others, whose patterns have nothing to do with the
    picture's, are spread evenly over all dots; what orders do to each other is left out.
    """
    zero, first, *others = order_shares(levels, depth_error)
    even = np.full_like(kernel, 1 / kernel.size)
    point = point_kernel(kernel.shape[0])
    return np.asarray(first * kernel + zero * point + sum(others) * even, np.float32)


def opened(kernel: FloatArray, variance: float) -> FloatArray:
    """Return a kernel (n, n) seen by areas whose variance along an axis is greater by `variance`.

    To first order the ratio of two small apertures is 1 + variance / 2 times the second
    difference, whichever is larger.

    Args:
        kernel: Of sum 1.
        variance: Sub-pixels squared; negative for smaller areas.
    """
    if variance == 0:
        return kernel
    wide = np.pad(kernel.astype(np.float64), 2)
    bend = -4 * wide[1:-1, 1:-1]
    bend += wide[:-2, 1:-1] + wide[2:, 1:-1] + wide[1:-1, :-2] + wide[1:-1, 2:]
    return np.asarray(wide[1:-1, 1:-1] + variance / 2 * bend, np.float32)


def _places(kernel: FloatArray) -> Floats:
    """Return where the cells of a kernel lie, (2, n, n)."""
    half = kernel.shape[0] // 2
    return np.stack(np.meshgrid(*[np.arange(-half, half + 1.0)] * 2, indexing="ij"))


def _shared(places: Floats, light: NDArray[np.floating]) -> FloatArray:
    """Place light at places (2, ...) on the grid of sub-pixels."""
    y, x = np.round(places.reshape(2, -1), 9)
    top, left = np.floor(y).astype(int), np.floor(x).astype(int)
    is_fractional = bool((y != top).any() or (x != left).any())
    half = math.ceil(max(float(np.abs(y).max()), float(np.abs(x).max())))
    grid = np.zeros((2 * half + 5, 2 * half + 5))
    for dy, dx in itertools.product(range(1 - REACH, REACH + 1), repeat=2):
        share = cubic(y - top - dy) * cubic(x - left - dx)
        np.add.at(grid, (top + dy + half + 2, left + dx + half + 2), share * light.ravel())
    edge = 1 if is_fractional else 2
    return np.asarray(grid[edge:-edge, edge:-edge], np.float32)
