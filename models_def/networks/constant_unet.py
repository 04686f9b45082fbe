"""The single-stage U-Net of Deep Optics, kept as a reference: as wide at every scale.

Five scales of 64 channels, two 3x3 convolutions each, max pooling on the way down. The paper gives
widths and scales; activation, upsampling (a 1x1 convolution with a pixel-shuffle) and no norm are
those of the other U-Nets here. The output is not added to the input: lights of 256 times white are
not a correction of a clipped capture.

References: Metzler, Ikoma, Peng and Wetzstein 2020; Sun 2021, tables 5.4 and 5.5.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.networks.lean_unet import Upsampling
from camkit.models_def.networks.trimmed_unet import double_conv


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantConfig:
    """Shape of a `ConstantUnet`.

    Attributes:
        width: Channels of every scale.
        scales: /1, /2, ...
        in_channels: 3 (one picture) or 6 (two).
    """

    width: int = 64
    scales: int = 5
    in_channels: int = 6

    def __post_init__(self) -> None:
        if self.width < 1 or self.scales < 2:
            raise ContractError(
                f"a U-Net needs width >= 1 and scales >= 2; got {self.width}, {self.scales}"
            )
        if self.in_channels not in (3, 6):
            raise ContractError(f"in_channels must be 3 or 6; got {self.in_channels}")


class ConstantUnet(nn.Module):
    """A U-Net of the same width at every scale."""

    def __init__(self, config: ConstantConfig | None = None) -> None:
        super().__init__()
        self.config = config or ConstantConfig()
        width, depth = self.config.width, self.config.scales - 1
        self.in_channels = self.config.in_channels
        self.stride_px = 2**depth
        self.encoders = nn.ModuleList(
            double_conv(width if i else self.in_channels, width) for i in range(depth + 1)
        )
        self.ups = nn.ModuleList(Upsampling(width, width, bias=True) for _ in range(depth))
        self.merges = nn.ModuleList(double_conv(2 * width, width) for _ in range(depth))
        self.out = nn.Conv2d(width, 3, 1)

    def forward(self, planes: Tensor) -> Tensor:
        """Return (b, 3, h, w) from (b, in_channels, h, w); h, w multiples of `stride_px`."""
        skips: list[Tensor] = []
        x = planes
        for i, encoder in enumerate(self.encoders):
            x = encoder(nn.functional.max_pool2d(x, 2) if i else x)
            skips.append(x)
        skips.pop()
        for i in reversed(range(len(skips))):
            x = self.merges[i](torch.cat([self.ups[i](x), skips[i]], dim=1))
        picture: Tensor = self.out(x)
        return picture
