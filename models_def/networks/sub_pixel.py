"""The CPU-first network that makes a picture four times as fine: all its work is at the coarse one.

    samples --+-- conv 3x3 -- residual blocks of two 3x3 -- conv 3x3 --(+)-- shuffle -- picture
              '------------------ linear 7x7 --------------------------'

What a linear filter can do, the skip does; the rest adds what it cannot. A new network is bicubic
interpolation at the true place of the samples.
"""

from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor, nn
from torch.nn import functional

from camkit.errors import ContractError
from camkit.models_def.networks.bicubic import PHASE, REACH, SCALE, bicubic_filters
from camkit.models_def.networks.lean_unet import CHANNEL_BLOCK, NEGATIVE_SLOPE, ResidualBlock

SKIP_PX: Final = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class SubPixelConfig:
    """Shape of a `SubPixel`.

    Attributes:
        width: Channels, a multiple of 16.
        blocks: Residual blocks.
        in_channels: Planes; the first are the samples, others tell about them (their noise).
        phase: Sub-pixel of its block, along either axis, at which a sample lies.
    """

    width: int = 32
    blocks: int = 4
    in_channels: int = 2
    phase: int = PHASE

    def __post_init__(self) -> None:
        if self.width < 1 or self.width % CHANNEL_BLOCK:
            raise ContractError(f"width must be a multiple of {CHANNEL_BLOCK}; got {self.width}")
        if self.blocks < 0 or self.in_channels < 1:
            raise ContractError(
                f"blocks must be >= 0, in_channels >= 1; got {self.blocks}, {self.in_channels}"
            )


SUB_PIXEL_S: Final = SubPixelConfig()
SUB_PIXEL_M: Final = SubPixelConfig(width=48, blocks=6)


class SubPixel(nn.Module):
    """The family; sizes differ in width and depth."""

    def __init__(self, config: SubPixelConfig) -> None:
        super().__init__()
        self.config = config
        self.in_channels = config.in_channels
        self.stride_px = 1
        outputs = SCALE**2
        self.skip = nn.Conv2d(config.in_channels, outputs, SKIP_PX, padding=SKIP_PX // 2)
        self.head = nn.Conv2d(config.in_channels, config.width, 3, padding=1)
        self.blocks = nn.Sequential(
            *(ResidualBlock(config.width, bias=True) for _ in range(config.blocks))
        )
        self.tail = nn.Conv2d(config.width, outputs, 3, padding=1)
        self._start()

    def _start(self) -> None:
        nn.init.kaiming_normal_(self.head.weight, a=NEGATIVE_SLOPE, nonlinearity="leaky_relu")
        for conv in (self.skip, self.tail):
            nn.init.zeros_(conv.weight)
        for conv in (self.skip, self.head, self.tail):
            nn.init.zeros_(torch.as_tensor(conv.bias))
        inside = slice(SKIP_PX // 2 - REACH, SKIP_PX // 2 + REACH + 1)
        with torch.no_grad():
            self.skip.weight[:, :1, inside, inside] = bicubic_filters(SCALE, self.config.phase)

    def forward(self, planes: Tensor) -> Tensor:
        """Make a picture finer.

        Args:
            planes: (b, in_channels, h, w).

        Returns:
            (b, 1, 4 h, 4 w).
        """
        x = functional.leaky_relu(self.head(planes), NEGATIVE_SLOPE)
        blocks = self.tail(self.blocks(x)) + self.skip(planes)
        return functional.pixel_shuffle(blocks, SCALE)
