"""Bicubic interpolation of samples that lie at a known sub-pixel of their pixels.

References: Keys 1981, eq. (4) with a = -0.5.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.spad.finer.linear import Grid

SHARPNESS: Final = -0.5
REACH: Final = 2
"""Samples to either side of a pixel's own."""


def cubic(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weight of a sample at a distance in samples."""
    x, a = np.abs(distance), SHARPNESS
    near = (a + 2) * x**3 - (a + 3) * x**2 + 1
    far = a * (x**3 - 5 * x**2 + 8 * x - 4)
    return np.where(x <= 1, near, np.where(x < 2, far, 0.0))


def bicubic(light: FloatArray, grid: Grid) -> FloatArray:
    """Return a picture (m h, m w) of samples (h, w); borders go on as they end."""
    rows = _finer(light.astype(np.float64), grid)
    return np.ascontiguousarray(_finer(rows.T, grid).T, np.float32)


def _finer(lines: NDArray[np.float64], grid: Grid) -> NDArray[np.float64]:
    """Make an array finer along its first axis."""
    scale, count = grid.scale, len(lines)
    wide = np.pad(lines, ((REACH, REACH), (0, 0)), mode="edge")
    offsets = (np.arange(scale) - grid.phase) / scale
    weights = cubic(offsets[:, None] - np.arange(-REACH, REACH + 1))
    samples = np.zeros((count, scale, lines.shape[1]))
    for number, column in enumerate(weights.T):
        samples += column[:, None] * wide[number : number + count, None]
    return samples.reshape(count * scale, -1)
