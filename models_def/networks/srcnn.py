"""SRCNN: three convolutions on the bicubic picture, to compare with.

References: Dong, Loy, He, Tang 2014 (9-1-5 and 9-5-5, 64 and 32 channels); thesis table 4.1.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from camkit.errors import ContractError
from camkit.models_def.networks.bicubic import PHASE, SCALE, Bicubic

WIDTHS = (64, 32)
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


class Srcnn(nn.Module):
    """Patches, a mapping between them, and the picture; borders are filled with zeros."""

    def __init__(self, config: SrcnnConfig) -> None:
        super().__init__()
        self.config = config
        self.in_channels = config.in_channels
        self.stride_px = 1
        self.finer = Bicubic(SCALE, config.phase)
        channels = (config.in_channels, *WIDTHS, 1)
        self.layers = nn.ModuleList(
            nn.Conv2d(channels[i], channels[i + 1], k, padding=k // 2)
            for i, k in enumerate(config.kernels_px)
        )
        for layer in self.layers:
            nn.init.kaiming_normal_(torch.as_tensor(layer.weight), nonlinearity="relu")
            nn.init.zeros_(torch.as_tensor(layer.bias))
        nn.init.normal_(torch.as_tensor(self.layers[-1].weight), std=FIRST_STD)

    def forward(self, planes: Tensor) -> Tensor:
        """Return the picture (b, 1, 4 h, 4 w) from (b, in_channels, h, w)."""
        x = self.finer(planes)
        for layer in list(self.layers)[:-1]:
            x = functional.relu(layer(x))
        return torch.as_tensor(self.layers[-1](x))
