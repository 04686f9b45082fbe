"""A Fourier transform onto any grid: part of the spectrum, as finely as is asked for.

By Bluestein's identity it is a convolution with a chirp: three FFTs of the sum of both lengths in
place of a matrix of their product.
"""

import math

import torch
from scipy.fft import next_fast_len
from torch import Tensor

from camkit.errors import ContractError


def zoom_fourier(field: Tensor, step: float, count: int) -> Tensor:
    """Transform the last axis; both grids are centred on 0.

    F[k] = sum over n of f[n] exp(-2 pi i step (n - (N - 1) / 2) (k - (count - 1) / 2))

    Args:
        field: (..., N) complex; the result has its precision (relative error about 1e-6 for
            complex64, 1e-14 for complex128).
        step: Spacing of the input times spacing of the output, in cycles; 1 / N is that of a DFT.
        count: Samples of the result.

    Returns:
        (..., count).

    Raises:
        ContractError: If the field is not complex, or `count` is not positive.
    """
    if not field.is_complex() or count < 1:
        raise ContractError(f"a complex field and a count > 0 are needed; got {field.dtype}")
    samples = field.shape[-1]
    length = next_fast_len(samples + count - 1)
    lag = torch.arange(1 - samples, count, dtype=torch.float64) + (samples - count) / 2
    kernel = torch.fft.fft(_wrapped(_chirp(lag, -step, field), samples, length))
    inner = field * _chirp(_centred(samples), step, field)
    mixed: Tensor = torch.fft.ifft(torch.fft.fft(inner, length) * kernel)[..., :count]
    return mixed * _chirp(_centred(count), step, field)


def zoom_fourier_2d(field: Tensor, step: float, count: int) -> Tensor:
    """Transform the last two axes, see `zoom_fourier`: (..., N, N) -> (..., count, count)."""
    columns = zoom_fourier(field.transpose(-2, -1), step, count)
    return zoom_fourier(columns.transpose(-2, -1), step, count)


def _centred(count: int) -> Tensor:
    return torch.arange(count, dtype=torch.float64) - (count - 1) / 2


def _chirp(place: Tensor, step: float, like: Tensor) -> Tensor:
    """Return exp(-i pi step place^2); whole cycles are taken away before they cost digits."""
    cycles = torch.remainder(step * place**2 / 2, 1.0)
    return torch.polar(torch.ones_like(cycles), -2 * math.pi * cycles).to(like.dtype)


def _wrapped(lags: Tensor, samples: int, length: int) -> Tensor:
    """Return lags 1 - samples .. count - 1 on a circle: negative ones at its end."""
    circle = torch.zeros(length, dtype=lags.dtype)
    circle[: lags.numel() - samples + 1] = lags[samples - 1 :]
    circle[length - samples + 1 :] = lags[: samples - 1]
    return circle
