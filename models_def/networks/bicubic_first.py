"""SRCNN and VDSR: plain convolutions on the bicubic picture, to compare with.

References: Dong, Loy, He, Tang 2014 (9-1-5 and 9-5-5, 64 and 32 channels); Kim, Lee, Lee 2016 (20
layers, 64 channels, residual); thesis table 4.1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

from camkit.errors import ContractError
from camkit.models_def.networks.bicubic import PHASE, SCALE, Bicubic

SRCNN_WIDTHS = (64, 32)
FIRST_STD = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class SrcnnConfig:
    """Shape of a `Srcnn`.

    Attributes:
        kernels_px: Sides of its three kernels, odd.
        in_channels: Planes.
        phase: Sub-pixel of its block at which a sample lies.
    """

    kernels_px: tuple[int, ...] = (9, 5, 5)
    in_channels: int = 1
    phase: int = PHASE

    def __post_init__(self) -> None:
        if len(self.kernels_px) != 3 or any(k < 1 or k % 2 == 0 for k in self.kernels_px):
            raise ContractError(f"kernels_px must be three odd sides; got {self.kernels_px}")
        if self.in_channels < 1:
            raise ContractError(f"in_channels must be >= 1; got {self.in_channels}")


@dataclass(frozen=True, slots=True, kw_only=True)
class VdsrConfig:
    """Shape of a `Vdsr`.

    Attributes:
        layers: Convolutions, two or more.
        width: Channels between them.
        in_channels: Planes; the first is the picture that is corrected.
        phase: Sub-pixel of its block at which a sample lies.
    """

    layers: int = 20
    width: int = 64
    in_channels: int = 1
    phase: int = PHASE

    def __post_init__(self) -> None:
        if self.layers < 2 or min(self.width, self.in_channels) < 1:
            raise ContractError(
                "layers must be >= 2, width and in_channels >= 1; got "
                f"{self.layers}, {self.width}, {self.in_channels}"
            )


class Srcnn(nn.Module):
    """Patches, a mapping between them, and the picture; borders are filled with zeros."""

    def __init__(self, config: SrcnnConfig) -> None:
        super().__init__()
        self.config = config
        self.in_channels = config.in_channels
        self.stride_px = 1
        self.finer = Bicubic(SCALE, config.phase)
        self.layers = _convolutions((config.in_channels, *SRCNN_WIDTHS, 1), config.kernels_px)
        nn.init.normal_(torch.as_tensor(self.layers[-1].weight), std=FIRST_STD)

    def forward(self, planes: Tensor) -> Tensor:
        """Return the picture (b, 1, 4 h, 4 w) from (b, in_channels, h, w)."""
        return _layered(self.layers, self.finer(planes))


class Vdsr(nn.Module):
    """Twenty 3x3 convolutions that correct the picture; a new one is bicubic interpolation."""

    def __init__(self, config: VdsrConfig) -> None:
        super().__init__()
        self.config = config
        self.in_channels = config.in_channels
        self.stride_px = 1
        self.finer = Bicubic(SCALE, config.phase)
        channels = (config.in_channels, *(config.width,) * (config.layers - 1), 1)
        self.layers = _convolutions(channels, (3,) * config.layers)
        nn.init.zeros_(torch.as_tensor(self.layers[-1].weight))

    def forward(self, planes: Tensor) -> Tensor:
        """Return the picture (b, 1, 4 h, 4 w) from (b, in_channels, h, w)."""
        fine: Tensor = self.finer(planes)
        return _layered(self.layers, fine) + fine[:, :1]


def _convolutions(channels: Sequence[int], kernels_px: Sequence[int]) -> nn.ModuleList:
    layers = nn.ModuleList(
        nn.Conv2d(inputs, outputs, side, padding=side // 2)
        for (inputs, outputs), side in zip(pairwise(channels), kernels_px, strict=True)
    )
    for layer in layers:
        nn.init.kaiming_normal_(torch.as_tensor(layer.weight), nonlinearity="relu")
        nn.init.zeros_(torch.as_tensor(layer.bias))
    return layers


def _layered(layers: nn.ModuleList, x: Tensor) -> Tensor:
    """Return the picture behind the layers, a ReLU between them."""
    for layer in list(layers)[:-1]:
        x = functional.relu(layer(x))
    return torch.as_tensor(layers[-1](x))
