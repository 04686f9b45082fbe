"""The error of the best linear estimate: Wiener theory on the covariance of natural pictures.

covariance C of pictures, kernel p, noise of N photons
    A   covariance of 7x7 samples    (p * p' * C)(4 (k - l)) + noise
    b   of a sub-pixel and samples   (p * C)(f - s_k)
    mean squared error of a sub-pixel: C(0) - b' A^-1 b, averaged over the 16 of a pixel

It needs no training, so the best Gaussian of a level of light is found in seconds.

References: Wiener 1949; the sampling is eq. (4.1) of the thesis.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.sampling import HALF, gaussian_psf
from camkit.models_def.networks.bicubic import PHASE, SCALE

REACH: Final = 3
"""Pixels to either side of a block whose samples are used: 7x7."""
LAGS: Final = SCALE * 2 * REACH + 2 * HALF
"""Sub-pixels: the largest distance at which a covariance is asked for."""
FLOOR: Final = 1e-7
"""Share of the variance that stands for what a covariance of few pictures cannot tell."""
SIGMAS: Final = (0.6, 4.0)
"""Sub-pixels: where the best Gaussian is sought."""
SEARCH_STEPS: Final = 40
_GOLDEN: Final = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Covariance:
    """Second moments of pictures.

    Attributes:
        values: (2 n + 1, 2 n + 1) float64 by distance in sub-pixels, the middle at 0; n >= `LAGS`.
        mean: Mean light, which makes the noise.
    """

    values: Tensor
    mean: float

    def __post_init__(self) -> None:
        side = 2 * LAGS + 1
        if self.values.ndim != 2 or min(self.values.shape) < side or self.values.shape[0] % 2 == 0:
            raise ContractError(
                f"a covariance must reach {LAGS} sub-pixels, ({side}, {side}) or more, odd; got "
                f"{tuple(self.values.shape)}"
            )


def covariance_of(crops: Iterable[NDArray[np.floating]]) -> Covariance:
    """Measure the covariance of crops (h, w) of one side, larger than `LAGS`.

    Every distance is averaged over the pairs that lie inside a crop; the mean is that of all.

    Raises:
        ContractError: If there is no crop.
    """
    arrays = [np.asarray(crop, np.float64) for crop in crops]
    if not arrays:
        raise ContractError("a covariance needs at least one crop")
    mean = float(np.mean([crop.mean() for crop in arrays]))
    side = arrays[0].shape[0] + LAGS + 1
    total = np.zeros((side, arrays[0].shape[1] + LAGS + 1))
    for crop in arrays:
        spectrum = np.fft.rfft2(crop - mean, s=total.shape)
        total += np.fft.irfft2(np.abs(spectrum) ** 2, s=total.shape)
    lags = np.arange(-LAGS, LAGS + 1)
    pairs = [n - np.abs(lags) for n in arrays[0].shape]
    values = total[np.ix_(lags, lags)] / (len(arrays) * np.outer(*pairs))
    return Covariance(values=torch.from_numpy(values), mean=mean)


def wiener_error(
    kernel: Tensor, covariance: Covariance, photons: float, phase: int = PHASE
) -> Tensor:
    """Return the mean squared error of the best linear estimate of all sub-pixels.

    Args:
        kernel: (11, 11) of unit sum; gradients reach it.
        covariance: Of the pictures.
        photons: Of white; inf for no noise.
        phase: Sub-pixel at which a pixel sees.
    """
    values = covariance.values
    kernel = kernel.double()
    # a sample is sum p(u) I(x - u), so it has C(d + u) in common with a sub-pixel d beside it
    shared = _spread(values, kernel.flip(0, 1))
    twice = _spread(shared, kernel)
    at = torch.arange(-REACH, REACH + 1) * SCALE
    rows, columns = (v.flatten() for v in torch.meshgrid(at, at, indexing="ij"))
    middle = twice.shape[0] // 2
    matrix = twice[middle + rows[:, None] - rows, middle + columns[:, None] - columns]
    noise = covariance.mean / photons + FLOOR * float(values[LAGS, LAGS])
    matrix = matrix + noise * torch.eye(len(matrix), dtype=torch.float64)
    inside = torch.arange(SCALE) - phase
    fine_rows, fine_columns = (v.flatten() for v in torch.meshgrid(inside, inside, indexing="ij"))
    middle = shared.shape[0] // 2
    cross = shared[middle + fine_rows[:, None] - rows, middle + fine_columns[:, None] - columns]
    explained = (cross * torch.linalg.solve(matrix, cross.T).T).sum(1)
    centre = values.shape[0] // 2
    return torch.as_tensor((values[centre, centre] - explained).mean())


def best_gaussian(covariance: Covariance, photons: float) -> float:
    """Return the sigma in sub-pixels of the Gaussian of least error at a level of light."""

    def error(sigma: float) -> float:
        kernel = torch.from_numpy(gaussian_psf(sigma))
        return float(wiener_error(kernel, covariance, photons))

    low, high = SIGMAS
    for _ in range(SEARCH_STEPS):
        step = _GOLDEN * (high - low)
        left, right = high - step, low + step
        if error(left) < error(right):
            high = right
        else:
            low = left
    return (low + high) / 2


def _spread(values: Tensor, kernel: Tensor) -> Tensor:
    """Convolve, where the kernel lies wholly inside."""
    return functional.conv2d(values[None, None], kernel.flip(0, 1)[None, None])[0, 0]
