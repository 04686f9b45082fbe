"""Light on its way to the sensor, in torch with gradients: blurred by one kernel or block by block.

`scatter` is the twin of `runtime.geometry.field_blur`; `tests/parity` holds the two together.
"""

from math import cos, pi
from typing import Any, Final

import numpy as np
import torch
from scipy.fft import next_fast_len
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn.functional import pad

from camkit.errors import ContractError

BLOCK_STEP_PX: Final = 128

Span = tuple[int, int, Tensor]


def blur(planes: Tensor, kernels: Tensor) -> Tensor:
    """Convolve planes with one kernel per channel and keep what has full support.

    Args:
        planes: (b, c, h, w).
        kernels: (b, c, kh, kw), as they fall on the sensor (scatter, not flipped).

    Returns:
        (b, c, h - kh + 1, w - kw + 1).

    Raises:
        ContractError: If a kernel is larger than the planes, or their numbers do not match.
    """
    (h, w), (kh, kw) = planes.shape[-2:], kernels.shape[-2:]
    if kh > h or kw > w:
        raise ContractError(f"kernels of {kh}x{kw} px exceed the planes of {h}x{w} px")
    try:
        np.broadcast_shapes(planes.shape[:-2], kernels.shape[:-2])
    except ValueError as error:
        raise ContractError(
            f"planes {tuple(planes.shape)} and kernels {tuple(kernels.shape)} do not match"
        ) from error
    spread: Tensor = _Convolution.apply(planes, kernels)  # type: ignore[no-untyped-call]
    return spread


class _Convolution(torch.autograd.Function):
    """The samples with full support in the convolution of (..., h, w) with (..., kh, kw).

    The slopes are correlations, by real transforms too: torch would go back through a real
    transform by a complex one, at twice the work.
    """

    @staticmethod
    def forward(ctx: Any, planes: Tensor, kernels: Tensor) -> Tensor:
        """Convolve; a circular product is free of wrapping where the kernel lies wholly inside."""
        (h, w), (kh, kw) = planes.shape[-2:], kernels.shape[-2:]
        size = next_fast_len(h, real=True), next_fast_len(w, real=True)
        spectra = _spectrum(planes, size), _spectrum(kernels, size)
        # each factor is what leads the slope to the other one
        factors = zip(reversed(spectra), ctx.needs_input_grad, strict=True)
        ctx.save_for_backward(*(s if need else None for s, need in factors))
        ctx.sides = planes.shape, kernels.shape, size
        spread: Tensor = torch.fft.irfft2(spectra[0] * spectra[1], size)
        return spread[..., kh - 1 : h, kw - 1 : w]

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor | None, Tensor | None]:
        """Correlate the slope with the other factor."""
        (slope,) = slopes
        planes, kernels, size = ctx.sides
        (h, w), (kh, kw) = planes[-2:], kernels[-2:]
        of_kernels, of_planes = ctx.saved_tensors
        padded = pad(slope, (kw - 1, size[1] - w, kh - 1, size[0] - h))
        spectrum = _spectrum(padded, size)

        def correlated(other: Tensor | None, shape: torch.Size) -> Tensor | None:
            if other is None:
                return None
            product = spectrum * other.conj()
            lead = (*shape[:-2], *product.shape[-2:])
            gradient: Tensor = torch.fft.irfft2(product.sum_to_size(lead), size)
            return gradient[..., : shape[-2], : shape[-1]]

        return correlated(of_kernels, planes), correlated(of_planes, kernels)


def scatter(planes: Tensor, kernels: Tensor, *, step_px: int = BLOCK_STEP_PX) -> Tensor:
    """Blur one picture whose PSF varies: each block is spread with its own kernels.

    Divided by the same of a field of ones, so that equal radiance stays equal.

    Args:
        planes: (c, h + 2 m, w + 2 m), m = k // 2: the picture and what lies around it.
        kernels: (rows, columns, c, k, k), one set per block; see `block_centres_px`.
        step_px: Distance of block centres.

    Returns:
        (c, h, w).

    Raises:
        ContractError: If the kernels do not match the blocks.
    """
    side = kernels.shape[-1]
    rows, columns = (_spans(n, step_px, planes) for n in planes.shape[-2:])
    if kernels.shape[:2] != (len(rows), len(columns)):
        raise ContractError(
            f"{len(rows)}x{len(columns)} blocks need as many kernels; got {kernels.shape[:2]}"
        )
    out = planes.new_zeros(len(planes), planes.shape[-2] + side - 1, planes.shape[-1] + side - 1)
    light = torch.zeros_like(out)
    for row, (top, bottom, row_weight) in enumerate(rows):
        for column, (left, right, column_weight) in enumerate(columns):
            weight = row_weight[:, None] * column_weight
            size = bottom - top + side - 1, right - left + side - 1
            transfer = _spectrum(kernels[row, column], size)
            place = slice(top, top + size[0]), slice(left, left + size[1])
            block = planes[:, top:bottom, left:right] * weight
            out[:, *place] += torch.fft.irfft2(_spectrum(block, size) * transfer, size)
            light[:, *place] += torch.fft.irfft2(_spectrum(weight[None], size) * transfer, size)
    inner = slice(side - 1, 1 - side if side > 1 else None)
    return out[:, inner, inner] / light[:, inner, inner]


def block_centres_px(length: int, margin_px: int, *, step_px: int = BLOCK_STEP_PX) -> Tensor:
    """Return the block centres along one side, in pixels of the picture inside the margin.

    Args:
        length: Side with margins.
        margin_px: Width of the margin.
        step_px: Distance of block centres.
    """
    spans = _spans(length, step_px, torch.zeros(1, dtype=torch.float64))
    return torch.tensor(
        [(first + last - 1) / 2 - margin_px for first, last, _ in spans], dtype=torch.float64
    )


def _spectrum(planes: Tensor, size: tuple[int, int]) -> Tensor:
    spectrum: Tensor = torch.fft.rfft2(planes, s=size)
    return spectrum


def _spans(length: int, step_px: int, like: Tensor) -> list[Span]:
    # Raised cosines that sum to 1; the outer ones stay at 1 towards the ends.
    count = max(1, round(length / step_px))
    pitch = length / count
    spans = []
    for index in range(count):
        weights = [_weight((x + 0.5) / pitch - index - 0.5, index, count) for x in range(length)]
        weighted = [x for x, weight in enumerate(weights) if weight > 0]
        first, last = weighted[0], weighted[-1] + 1
        spans.append((first, last, like.new_tensor(weights[first:last])))
    return spans


def _weight(distance: float, index: int, count: int) -> float:
    beyond_start = index == 0 and distance < 0
    beyond_end = index == count - 1 and distance > 0
    if beyond_start or beyond_end:
        return 1.0
    return 0.5 + 0.5 * cos(pi * distance) if abs(distance) < 1 else 0.0
