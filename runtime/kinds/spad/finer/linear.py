"""The best linear estimate of a picture from photons behind a plate, at one level of light.

covariance C of pictures, kernel p, n photons of a pixel on average
    A   of 7x7 samples              (p * p' * C)(m (k - l)) + 1 / n on the diagonal
    b   of a sub-pixel and samples  (p' * C)(f - m k), p' the kernel turned about
    weights w: least error among those whose sum is 1, so that no mean need be known
        [A 1; 1' 0] [w; l] = [b; 1]

Weights of unit sum keep photons what they are; independent counts of variance v become a
sub-pixel of variance v sum(w^2).

References: Wiener 1949; Matheron 1963 for unknown means; the sampling is eq. (4.1) of Sun 2021.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import convolve

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.finer.covariance import PictureCovariance

REACH: Final = 3
"""Pixels to either side of a pixel whose photons are used: 7x7."""
SIDE: Final = 2 * REACH + 1
FEWEST: Final = 1e-3
"""Photons of a pixel: fewer change no weight any more."""
AT_ONCE: Final = 262_144
"""Pixels that are filtered at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """The sampling of a pixel on the fine grid.

    Attributes:
        scale: Sub-pixels along a side of a pixel.
        phase: The one, along either axis, at which it sees.
    """

    scale: int
    phase: int

    def __post_init__(self) -> None:
        if not 0 <= self.phase < self.scale:
            raise ContractError(f"phase must be one of 0..{self.scale - 1}; got {self.phase}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearEstimate:
    """A filter from pixels to their sub-pixels.

    Attributes:
        weights: (m^2, 7, 7) of unit sum each, sub-pixels row by row.
        scale: m.
    """

    weights: FloatArray
    scale: int

    @property
    def noise_gain(self) -> FloatArray:
        """Return what becomes of the deviation of independent counts, (m, m)."""
        gains = np.sqrt(np.square(self.weights, dtype=np.float64).sum(axis=(1, 2)))
        return np.asarray(gains.reshape(self.scale, self.scale), np.float32)

    @property
    def largest(self) -> FloatArray:
        """Return how much of a sub-pixel one photon makes at most, (m, m)."""
        most = self.weights.max(axis=(1, 2))
        return np.asarray(most.reshape(self.scale, self.scale), np.float32)

    def __call__(self, frames: FloatArray) -> FloatArray:
        """Return pictures (n, m h, m w) of photons (n, h, w); borders go on as they end."""
        count, height, width = frames.shape
        wide = np.pad(frames, ((0, 0), (REACH, REACH), (REACH, REACH)), mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(wide, (SIDE, SIDE), axis=(1, 2))
        table = self.weights.reshape(len(self.weights), -1).T
        scale = self.scale
        pictures = np.empty((count, height, scale, width, scale), np.float32)
        step = max(1, AT_ONCE // (height * width))
        for start in range(0, count, step):
            check_wish()
            some = windows[start : start + step].reshape(-1, SIDE * SIDE) @ table
            block = some.reshape(-1, height, width, scale, scale)
            pictures[start : start + step] = block.transpose(0, 1, 3, 2, 4)
        return pictures.reshape(count, scale * height, scale * width)


def linear_estimate(
    kernel: FloatArray, grid: Grid, covariance: PictureCovariance, photons: float
) -> LinearEstimate:
    """Return the best linear estimate at a level of light.

    Args:
        kernel: (n, n), n odd, of unit sum: the light of a point as it falls on the sub-pixels.
        grid: Where a pixel sees.
        covariance: Of pictures.
        photons: Of a pixel, on average; inf for no noise.

    Raises:
        ContractError: If the kernel is not as stated, or photons are negative or NaN.
    """
    if kernel.ndim != 2 or kernel.shape[0] != kernel.shape[1] or kernel.shape[0] % 2 == 0:
        raise ContractError(f"a kernel must be (n, n) with n odd; got {kernel.shape}")
    if not photons >= 0:
        raise ContractError(f"photons must be >= 0; got {photons}")
    scale, half = grid.scale, kernel.shape[0] // 2
    spread = np.asarray(kernel, np.float64)
    values = covariance.lags(scale * 2 * REACH + 2 * half)
    # a sample is sum p(u) I(x - u), so it has C(d + u) in common with a sub-pixel d beside it
    cross = convolve(values, spread[::-1, ::-1], mode="valid")
    twice = convolve(cross, spread, mode="valid")
    at = scale * np.arange(-REACH, REACH + 1)
    rows, columns = (axis.ravel() for axis in np.meshgrid(at, at, indexing="ij"))
    inside = np.arange(scale) - grid.phase
    fine_rows, fine_columns = (axis.ravel() for axis in np.meshgrid(inside, inside, indexing="ij"))
    count = len(rows)
    system = np.ones((count + 1, count + 1))
    system[:count, :count] = _at(twice, rows[:, None] - rows, columns[:, None] - columns)
    system[range(count), range(count)] += 1 / max(photons, FEWEST)
    system[count, count] = 0
    right_side = np.ones((count + 1, scale**2))
    right_side[:count] = _at(cross, fine_rows - rows[:, None], fine_columns - columns[:, None])
    weights = np.linalg.solve(system, right_side)[:count].T
    return LinearEstimate(weights=weights.reshape(-1, SIDE, SIDE).astype(np.float32), scale=scale)


def _at(
    values: NDArray[np.float64], rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> NDArray[np.float64]:
    middle = values.shape[0] // 2
    return np.asarray(values[middle + rows, middle + columns])
