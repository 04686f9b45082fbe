"""VDSR: twenty 3x3 convolutions that correct the bicubic picture, to compare with.

References: Kim, Lee, Lee 2016 (20 layers, 64 channels, residual); thesis table 4.1.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from camkit.errors import ContractError
from camkit.models_def.networks.bicubic import PHASE, SCALE, Bicubic


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


class Vdsr(nn.Module):
    """A new one is bicubic interpolation."""

    def __init__(self, config: VdsrConfig) -> None:
        super().__init__()
        self.config = config
        self.in_channels = config.in_channels
        self.stride_px = 1
        self.finer = Bicubic(SCALE, config.phase)
        channels = (config.in_channels, *(config.width,) * (config.layers - 1), 1)
        self.layers = nn.ModuleList(
            nn.Conv2d(channels[i], channels[i + 1], 3, padding=1) for i in range(config.layers)
        )
        for layer in self.layers:
            nn.init.kaiming_normal_(torch.as_tensor(layer.weight), nonlinearity="relu")
            nn.init.zeros_(torch.as_tensor(layer.bias))
        nn.init.zeros_(torch.as_tensor(self.layers[-1].weight))

    def forward(self, planes: Tensor) -> Tensor:
        """Return the picture (b, 1, 4 h, 4 w) from (b, in_channels, h, w)."""
        fine = self.finer(planes)
        x = fine
        for layer in list(self.layers)[:-1]:
            x = functional.relu(layer(x))
        return torch.as_tensor(self.layers[-1](x) + fine[:, :1])
