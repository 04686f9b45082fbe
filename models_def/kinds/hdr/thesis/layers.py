"""Layers of the thesis's networks. References: Sun 2021, tables 5.1 to 5.3."""

from typing import Any, Final

import torch
from torch import Tensor, nn

from camkit.models_def.networks.instance_norm import instance_norm

SLOPE: Final = 0.2


class ScaledNorm(nn.Module):
    """nm(x) = w0 x + w1 instance_norm(x); the identity at first. References: table 5.1."""

    sees_whole_picture: Final = True

    def __init__(self) -> None:
        super().__init__()
        self.plain = nn.Parameter(torch.ones(()))
        self.normed = nn.Parameter(torch.zeros(()))

    def forward(self, x: Tensor) -> Tensor:
        """Return (b, c, h, w) from the same."""
        return self.plain * x + self.normed * instance_norm(x)


class InstanceNorm(nn.Module):
    """An instance norm with gain and offset of each channel. References: table 5.2."""

    sees_whole_picture: Final = True

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.gain = nn.Parameter(torch.ones(channels))
        self.offset = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor) -> Tensor:
        """Return (b, c, h, w) from the same."""
        return self.gain[:, None, None] * instance_norm(x) + self.offset[:, None, None]


def conv(inputs: int, outputs: int, size: int, *, dilation: int = 1) -> nn.Conv2d:
    """Return a convolution that keeps the size of a picture, ready for a leaky ReLU behind it."""
    layer = nn.Conv2d(inputs, outputs, size, padding=dilation * (size // 2), dilation=dilation)
    nn.init.kaiming_normal_(layer.weight, a=SLOPE, nonlinearity="leaky_relu")
    nn.init.zeros_(torch.as_tensor(layer.bias))
    return layer


def active(layer: nn.Module, *norm: nn.Module) -> nn.Sequential:
    """Return a row of a table: convolution, leaky ReLU, norm if there is one, in this order."""
    return nn.Sequential(layer, nn.LeakyReLU(SLOPE), *norm)


class _Clip(torch.autograd.Function):
    """Clips values, not gradients."""

    @staticmethod
    def forward(_context: Any, x: Tensor, low: float, high: float) -> Tensor:
        return x.clamp(low, high)

    @staticmethod
    def backward(_context: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        return gradient, None, None


def clip(x: Tensor, low: float, high: float) -> Tensor:
    """Clip values; gradients pass as if nothing were clipped.

    The thesis clips what its networks give. With the gradient of a clip, what is once outside
    would never come back.
    """
    clipped: Tensor = _Clip.apply(x, low, high)  # type: ignore[no-untyped-call]
    return clipped
