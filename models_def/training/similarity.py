"""Structural similarity with gradients.

References: Wang, Bovik, Sheikh, Simoncelli 2004.
"""

from typing import Final

import torch
from torch import Tensor
from torch.nn.functional import conv2d

_SIGMA_PX: Final = 1.5
_RADIUS_PX: Final = 5
_STABLE: Final = (0.01**2, 0.03**2)


def ssim(one: Tensor, other: Tensor) -> Tensor:
    """Return the mean SSIM (b,) of pictures (b, c, h, w) with values in 0..1, 11 px Gaussian."""
    channels = one.shape[1]
    line = torch.arange(-_RADIUS_PX, _RADIUS_PX + 1, dtype=one.dtype, device=one.device)
    weight = torch.exp(-0.5 * (line / _SIGMA_PX) ** 2)
    weight = (weight / weight.sum()).expand(channels, 1, 1, -1)

    def mean(picture: Tensor) -> Tensor:
        rows = conv2d(picture, weight, groups=channels)
        return conv2d(rows, weight.transpose(-1, -2), groups=channels)

    a, b = mean(one), mean(other)
    spread = mean(one * one) - a * a + mean(other * other) - b * b
    shared = mean(one * other) - a * b
    c1, c2 = _STABLE
    value = (2 * a * b + c1) * (2 * shared + c2) / ((a * a + b * b + c1) * (spread + c2))
    result: Tensor = value.flatten(1).mean(1)
    return result
