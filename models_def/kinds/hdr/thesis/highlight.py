"""The highlight reconstruction network: from the streaks to the lights that wrote them.

    /1    7x7, 3x3 (32) ------------------ concat -- 3x3, 3x3 (32), no norm -- 1x1 (3)
    /2      3x3, 3x3 (64) ----------- concat -- 3x3, 3x3 (64)
    /4        3x3, 3x3 (128) ----- concat -- 3x3, 3x3 (128)
    /8          3x3, 3x3 (256) - concat -- 3x3, 3x3 (256)
    /16           3x3, 3x3 (512)

Max pooling on the way down; on the way up the nearest neighbour twice as large and a 3x3
convolution, which table 5.2 names without its channels, norm and activation: it halves the
channels, as the concatenation with the encoder's wants, and has neither. The order of norm and
activation is that of the table's columns and of the text on the splitting network.

References: Sun 2021, section 5.4, eq. (5.4), table 5.2; Ronneberger et al. 2015.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.layers import InstanceNorm, active, clip, conv

MOST_LIGHT: Final = 256.0
"""2^8; lights are clipped to 1..2^8."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HighlightConfig:
    """Shape of a `HighlightUnet`.

    Attributes:
        widths: Channels at /1, /2, ...
    """

    widths: tuple[int, ...] = (32, 64, 128, 256, 512)

    def __post_init__(self) -> None:
        if len(self.widths) < 2 or min(self.widths) < 1:
            raise ContractError(f"widths must be two or more positive integers; got {self.widths}")


class HighlightUnet(nn.Module):
    """The highlight reconstruction network."""

    def __init__(self, config: HighlightConfig | None = None) -> None:
        super().__init__()
        self.config = config or HighlightConfig()
        widths = self.config.widths
        pairs = list(pairwise(widths))
        self.stride_px = 2 ** len(pairs)
        self.encoders = nn.ModuleList(
            [_normed(3, widths[0], 7), *(_normed(a, b, 3) for a, b in pairs)]
        )
        self.ups = nn.ModuleList(conv(b, a, 3) for a, b in pairs)
        self.decoders = nn.ModuleList(
            [_plain(2 * widths[0], widths[0]), *(_normed(2 * a, a, 3) for a in widths[1:-1])]
        )
        self.last = nn.Conv2d(widths[0], 3, 1)

    def forward(self, streaks: Tensor) -> Tensor:
        """Return (b, 3, h, w) lights, 1..2^8, from streaks; h, w multiples of 16."""
        skips: list[Tensor] = []
        x = streaks
        for i, encoder in enumerate(self.encoders):
            x = encoder(nn.functional.max_pool2d(x, 2) if i else x)
            skips.append(x)
        skips.pop()
        for i in reversed(range(len(skips))):
            upsampled = self.ups[i](nn.functional.interpolate(x, scale_factor=2, mode="nearest"))
            x = self.decoders[i](torch.cat([upsampled, skips[i]], dim=1))
        return clip(self.last(x), 1, MOST_LIGHT)


def _normed(inputs: int, outputs: int, first: int) -> nn.Sequential:
    return nn.Sequential(
        active(conv(inputs, outputs, first), InstanceNorm(outputs)),
        active(conv(outputs, outputs, 3), InstanceNorm(outputs)),
    )


def _plain(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(active(conv(inputs, outputs, 3)), active(conv(outputs, outputs, 3)))
