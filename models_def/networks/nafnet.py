"""The network without activation functions of Chen et al., a reference.

    input -- intro 3x3 -- E1 ------------------- (+) -- D1 -- ending 3x3 -- (+) -- output
               |          | 2x2, /2               | 1x1, shuffle             |
               |          E2 ----------- (+) ---- D2                         |
               |          '--- middle ---'                                   |
               '------------------- last three planes -----------------------'

    block: x + b conv(share(gate(depthwise(conv(norm(x)))))), then x + g conv(gate(conv(norm(x))))
    gate: half of the channels times the other half; share: times a 1x1 of their picture's mean

What a pixel becomes depends on the mean of its whole picture: it is trained on patches, judged on
pictures, and no exact tiles can be cut, so no bundle holds one. The convolution at the end begins
at zero, as that of `LeanUnet` does; in the publication it begins at random.

References: Chen, Chu, Zhang, Sun 2022, Simple Baselines for Image Restoration.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from camkit.errors import ContractError

NORM_EPSILON = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class NafConfig:
    """Shape of a `Nafnet`.

    Attributes:
        width: Channels at full resolution; they double with every scale.
        encoder_blocks: Blocks per scale on the way down; the publication has (1, 1, 1, 28) for
            blur and (2, 2, 4, 8) for noise.
        middle_blocks: Blocks at the last scale; there 1 and 12.
        decoder_blocks: Blocks per scale on the way up, the finest last; there (1, 1, 1, 1) and
            (2, 2, 2, 2).
        in_channels: 6 (capture and Wiener planes) or 3 (one picture).
    """

    width: int = 16
    encoder_blocks: tuple[int, ...] = (1, 1, 1, 1)
    middle_blocks: int = 1
    decoder_blocks: tuple[int, ...] = (1, 1, 1, 1)
    in_channels: int = 6

    def __post_init__(self) -> None:
        if len(self.encoder_blocks) != len(self.decoder_blocks):
            raise ContractError(
                "encoder and decoder need as many scales; got "
                f"{self.encoder_blocks}, {self.decoder_blocks}"
            )
        if min(self.width, self.middle_blocks, *self.encoder_blocks, *self.decoder_blocks) < 1:
            raise ContractError("width and block counts must be >= 1")
        if self.in_channels not in (3, 6):
            raise ContractError(f"in_channels must be 3 or 6; got {self.in_channels}")


class ChannelNorm(nn.Module):
    """Zero mean and unit variance over the channels of every pixel, then a scale and an offset."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.ones(channels))
        self.bias = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor) -> Tensor:
        """Return (b, c, h, w) from (b, c, h, w)."""
        deviation = x - x.mean(1, keepdim=True)
        normed = deviation / (deviation.square().mean(1, keepdim=True) + NORM_EPSILON).sqrt()
        return normed * self.weight[:, None, None] + self.bias[:, None, None]


class NafBlock(nn.Module):
    """A block; a new one returns its input."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        double = 2 * channels
        self.norm_space = ChannelNorm(channels)
        self.widen = nn.Conv2d(channels, double, 1)
        self.depthwise = nn.Conv2d(double, double, 3, padding=1, groups=double)
        self.share = nn.Conv2d(channels, channels, 1)
        self.join = nn.Conv2d(channels, channels, 1)
        self.norm_channels = ChannelNorm(channels)
        self.widen_again = nn.Conv2d(channels, double, 1)
        self.join_again = nn.Conv2d(channels, channels, 1)
        self.beta = nn.Parameter(torch.zeros(channels))
        self.gamma = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor) -> Tensor:
        """Return (b, c, h, w) from (b, c, h, w)."""
        y = gated(self.depthwise(self.widen(self.norm_space(x))))
        y = self.join(y * self.share(y.mean((2, 3), keepdim=True)))
        x = x + y * self.beta[:, None, None]
        y = self.join_again(gated(self.widen_again(self.norm_channels(x))))
        out: Tensor = x + y * self.gamma[:, None, None]
        return out


def gated(x: Tensor) -> Tensor:
    """Return (b, c, h, w): the first half of (b, 2c, h, w) times the second."""
    half = x.shape[1] // 2
    return x[:, :half] * x[:, half:]


def _blocks(count: int, channels: int) -> nn.Sequential:
    return nn.Sequential(*(NafBlock(channels) for _ in range(count)))


class Nafnet(nn.Module):
    """The network; a new one returns its last three input planes unchanged."""

    def __init__(self, config: NafConfig | None = None) -> None:
        super().__init__()
        self.config = config or NafConfig()
        self.in_channels = self.config.in_channels
        scales = len(self.config.encoder_blocks)
        self.stride_px = 2**scales
        widths = [self.config.width * 2**scale for scale in range(scales + 1)]
        self.intro = nn.Conv2d(self.in_channels, widths[0], 3, padding=1)
        self.encoders = nn.ModuleList(map(_blocks, self.config.encoder_blocks, widths))
        self.downs = nn.ModuleList(nn.Conv2d(c, 2 * c, 2, 2) for c in widths[:-1])
        self.middle = _blocks(self.config.middle_blocks, widths[-1])
        self.ups = nn.ModuleList(
            nn.Sequential(nn.Conv2d(2 * c, 4 * c, 1, bias=False), nn.PixelShuffle(2))
            for c in reversed(widths[:-1])
        )
        self.decoders = nn.ModuleList(
            map(_blocks, self.config.decoder_blocks, reversed(widths[:-1]))
        )
        self.ending = nn.Conv2d(widths[0], 3, 3, padding=1)
        nn.init.zeros_(self.ending.weight)

    def forward(self, planes: Tensor) -> Tensor:
        """Restore the last three planes.

        Args:
            planes: (b, in_channels, h, w) float32, stabilised; h, w multiples of `stride_px`.

        Returns:
            (b, 3, h, w) float32, stabilised.
        """
        x = self.intro(planes)
        skips = []
        for encoder, halving in zip(self.encoders, self.downs, strict=True):
            x = encoder(x)
            skips.append(x)
            x = halving(x)
        x = self.middle(x)
        for widening, decoder, skip in zip(self.ups, self.decoders, reversed(skips), strict=True):
            x = decoder(widening(x) + skip)
        restored: Tensor = planes[:, -3:] + self.ending(x)
        return restored
