"""The residual splitting network: a capture into the picture without streaks, and the streaks.

    capture --+--------------------------------------.
              '-- VGG-19: conv1_2 ... conv5_2, upsampled -- concat (1475) -- 1x1 -- 64
                                               3x3, dilations 1 2 4 8 16 32 64 1 -- 1x1 -- 6
    I_U = clip(capture + first three, 0, 1)         I_r = clip(last three, 0, 2^4)

The 1x1 convolution behind the hypercolumn and the bilinear upsampling before it are both linear,
one over channels and one over places, so they may change places: each level is compressed to 64
channels at its own size and the results are upsampled and added. That is the default; `early=False`
computes the 1475 channels at full size as the text has it.

What the text leaves open follows the source that it cites: average pooling, features behind the
ReLU, and an identity at first. There are eight 3x3 convolutions, as in table 5.1; the text of
section 5.4 says seven and counts those of growing dilation only.

References: Sun 2021, section 5.4, eq. (5.3), table 5.1; Zhang, Ng and Chen 2018 (perceptual
    reflection removal).
"""

from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.layers import SLOPE, ScaledNorm, active, clip, conv
from camkit.models_def.networks.vgg import WIDTHS, Pooling, VggLevels

DILATIONS: Final = (1, 2, 4, 8, 16, 32, 64, 1)
MOST_STREAK: Final = 16.0
"""2^4, where I_r is clipped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SplittingConfig:
    """Shape of a `SplittingNetwork`.

    Attributes:
        width: Channels of all layers behind the hypercolumn.
        dilations: Of the 3x3 convolutions.
        vgg_widths: Channels of the five blocks of VGG-19; others for tests.
        pooling: Of VGG-19.
        early: Whether the 1x1 convolution comes before the upsampling.
    """

    width: int = 64
    dilations: tuple[int, ...] = DILATIONS
    vgg_widths: tuple[int, ...] = WIDTHS
    pooling: Pooling = "average"
    early: bool = True

    def __post_init__(self) -> None:
        if self.width < 1 or not self.dilations or min(self.dilations) < 1:
            raise ContractError(
                "a splitting network needs a width and dilations >= 1; got "
                f"{self.width}, {self.dilations}"
            )

    @property
    def hypercolumn(self) -> int:
        """Channels of the picture and all features."""
        return 3 + sum(self.vgg_widths)


class SplittingNetwork(nn.Module):
    """The splitting network; a new one gives the capture and no streaks."""

    def __init__(self, config: SplittingConfig | None = None) -> None:
        super().__init__()
        self.config = config or SplittingConfig()
        width, widths = self.config.width, self.config.vgg_widths
        self.stride_px = 2 ** (len(widths) - 1)
        self.vgg = VggLevels(blocks=len(widths), widths=widths, pooling=self.config.pooling)
        self.compress = conv(self.config.hypercolumn, width, 1)
        self.first = nn.Sequential(nn.LeakyReLU(SLOPE), ScaledNorm())
        self.dilated = nn.Sequential(
            *(active(_identity(width, d), ScaledNorm()) for d in self.config.dilations)
        )
        self.last = nn.Conv2d(width, 6, 1)
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(torch.as_tensor(self.last.bias))

    def forward(self, capture: Tensor) -> tuple[Tensor, Tensor]:
        """Split a capture.

        Args:
            capture: (b, 3, h, w) linear; h, w multiples of 16. What is above white is cut.

        Returns:
            (b, 3, h, w) without streaks, 0..1, and (b, 3, h, w) of streaks, 0..2^4.
        """
        picture = capture.clamp(0, 1)
        levels = (picture, *self.vgg(picture))
        column = self._compressed(levels) if self.config.early else self._naive(levels)
        six = self.last(self.dilated(self.first(column)))
        return clip(picture + six[:, :3], 0, 1), clip(six[:, 3:], 0, MOST_STREAK)

    def _naive(self, levels: tuple[Tensor, ...]) -> Tensor:
        size = levels[0].shape[-2:]
        column: Tensor = self.compress(torch.cat([_upsampled(x, size) for x in levels], dim=1))
        return column

    def _compressed(self, levels: tuple[Tensor, ...]) -> Tensor:
        size = levels[0].shape[-2:]
        parts = torch.split(self.compress.weight, [x.shape[1] for x in levels], dim=1)
        column = nn.functional.conv2d(levels[0], parts[0], self.compress.bias)
        for level, weight in zip(levels[1:], parts[1:], strict=True):
            column = column + _upsampled(nn.functional.conv2d(level, weight), size)
        return column


def _upsampled(x: Tensor, size: torch.Size) -> Tensor:
    if x.shape[-2:] == size:
        return x
    return nn.functional.interpolate(x, size=tuple(size), mode="bilinear", align_corners=False)


def _identity(width: int, dilation: int) -> nn.Conv2d:
    layer = conv(width, width, 3, dilation=dilation)
    nn.init.dirac_(layer.weight)
    return layer
