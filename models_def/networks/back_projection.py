"""Dense deep back-projection, the network of the thesis's chapter 4, to compare with.

    samples -- conv 3x3 -- conv 1x1 -- up 1 -- down 1 -- up 2 -- ... -- up T -- conv 3x3 -- picture

    up    H0 = deconv(L), L0 = conv(H0), H = H0 + deconv(L0 - L)     eq. (4.3)
    down  L0 = conv(H), H0 = deconv(L0), L = L0 + conv(H0 - H)       eq. (4.4)

Every unit is given all earlier outputs of its resolution, merged by a 1x1 convolution where they
are several; the last convolution sees all of the fine ones.

References: Haris, Shakhnarovich, Ukita 2018; thesis 4.3.2.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from camkit.errors import ContractError

KERNEL_PX, STRIDE, PADDING = 8, 4, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class BackProjectionConfig:
    """Shape of a `BackProjection`; the defaults are those of the thesis.

    Attributes:
        stages: T, up-projections; one down-projection fewer.
        first_width: n0, channels of the first convolution.
        width: nR, channels of every unit.
        in_channels: Planes.
    """

    stages: int = 7
    first_width: int = 256
    width: int = 64
    in_channels: int = 1

    def __post_init__(self) -> None:
        if min(self.stages, self.first_width, self.width, self.in_channels) < 1:
            raise ContractError(
                "stages, first_width, width and in_channels must be >= 1; got "
                f"{self.stages}, {self.first_width}, {self.width}, {self.in_channels}"
            )


def _conv(inputs: int, outputs: int, size_px: int) -> nn.Sequential:
    conv = nn.Conv2d(inputs, outputs, size_px, padding=size_px // 2)
    return nn.Sequential(conv, nn.PReLU())


def _magnified(width: int) -> nn.Sequential:
    conv = nn.ConvTranspose2d(width, width, KERNEL_PX, STRIDE, PADDING)
    return nn.Sequential(conv, nn.PReLU())


def _reduced(width: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(width, width, KERNEL_PX, STRIDE, PADDING), nn.PReLU())


class Projection(nn.Module):
    """A unit: to the other resolution, back, and the error of that taken there too."""

    def __init__(self, maps: int, width: int, *, magnifies: bool) -> None:
        super().__init__()
        self.merge = _conv(maps * width, width, 1) if maps > 1 else nn.Identity()
        there, back = (_magnified, _reduced) if magnifies else (_reduced, _magnified)
        self.there, self.back, self.error = there(width), back(width), there(width)

    def forward(self, earlier: Tensor) -> Tensor:
        """Return the maps of the other resolution from all earlier ones of this."""
        x = self.merge(earlier)
        first = self.there(x)
        return torch.as_tensor(first + self.error(self.back(first) - x))


class BackProjection(nn.Module):
    """D-DBPN for four times the resolution."""

    def __init__(self, config: BackProjectionConfig) -> None:
        super().__init__()
        self.config = config
        self.in_channels = config.in_channels
        self.stride_px = 1
        width, stages = config.width, config.stages
        self.features = nn.Sequential(
            _conv(config.in_channels, config.first_width, 3), _conv(config.first_width, width, 1)
        )
        self.ups = nn.ModuleList(
            Projection(max(1, i), width, magnifies=True) for i in range(stages)
        )
        self.downs = nn.ModuleList(
            Projection(i + 1, width, magnifies=False) for i in range(stages - 1)
        )
        self.picture = nn.Conv2d(stages * width, 1, 3, padding=1)
        for layer in self.modules():
            if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d):
                nn.init.kaiming_normal_(layer.weight)
                nn.init.zeros_(torch.as_tensor(layer.bias))

    def forward(self, planes: Tensor) -> Tensor:
        """Return the picture (b, 1, 4 h, 4 w) from (b, in_channels, h, w)."""
        coarse = self.features(planes)
        fine = [self.ups[0](coarse)]
        coarse_maps: list[Tensor] = []
        for magnify, reduce in zip(list(self.ups)[1:], self.downs, strict=True):
            coarse_maps.append(reduce(torch.cat(fine, 1)))
            fine.append(magnify(torch.cat(coarse_maps, 1)))
        return torch.as_tensor(self.picture(torch.cat(fine, 1)))
