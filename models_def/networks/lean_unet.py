"""The CPU-first recovery network: a small residual U-Net of plain 3x3 convolutions.

    input --+-- head 6x6, /2 -- E1 -------------- (+) -- D1 -- tail 3x3, shuffle -- (+) -- output
            |                   | down             | up                             |
            |                   E2 --------- (+) - D2                               |
            |                   | down        | up                                  |
            |                   '-- middle ---'                                     |
            '--------------------------- last three planes -------------------------'

    E, D, middle: residual blocks x + conv(leaky_relu(conv(x)))

No normalisation, attention or products of activations: the network is piecewise linear, bounded on
inputs it never saw, and a bias-free one scales with its input. The pixel-unshuffle is folded into
the strided head and every upsampling is a 1x1 convolution with a pixel-shuffle, so that each output
pixel is computed by the same sums wherever its window lies.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import torch
from torch import Tensor, nn

from camkit.errors import ContractError

NEGATIVE_SLOPE = 0.1
CHANNEL_BLOCK = 16
BRANCH_GAIN = 0.3  # start of a residual branch: the stream must not grow with the depth


@dataclass(frozen=True, slots=True, kw_only=True)
class LeanConfig:
    """Shape of a `LeanUnet`.

    Attributes:
        widths: Channels at /2, /4, /8, ...; multiples of 16, since wide vector units compute in
            blocks of 16 and 24 channels would cost what 32 do.
        encoder_blocks: Residual blocks per scale on the way down, all scales but the last.
        decoder_blocks: Residual blocks per scale on the way up, all scales but the last.
        middle_blocks: Residual blocks at the last scale.
        in_channels: 6 (capture and Wiener planes) or 3 (one picture).
        bias: Whether convolutions have a bias; without one the network scales with its input.
    """

    widths: tuple[int, ...]
    encoder_blocks: tuple[int, ...]
    decoder_blocks: tuple[int, ...]
    middle_blocks: int = 1
    in_channels: int = 6
    bias: bool = False

    def __post_init__(self) -> None:
        if len(self.widths) < 2 or any(w <= 0 or w % CHANNEL_BLOCK for w in self.widths):
            raise ContractError(
                f"widths must be two or more multiples of {CHANNEL_BLOCK}; got {self.widths}"
            )
        scales = len(self.widths) - 1
        if len(self.encoder_blocks) != scales or len(self.decoder_blocks) != scales:
            raise ContractError(
                f"{len(self.widths)} widths need {scales} encoder and decoder entries; "
                f"got {self.encoder_blocks}, {self.decoder_blocks}"
            )
        if min(*self.encoder_blocks, *self.decoder_blocks, self.middle_blocks) < 0:
            raise ContractError("block counts must be >= 0")
        if self.in_channels not in (3, 6):
            raise ContractError(f"in_channels must be 3 or 6; got {self.in_channels}")


LEAN_S = LeanConfig(
    widths=(16, 32, 32), encoder_blocks=(0, 1), decoder_blocks=(1, 0), middle_blocks=2
)
LIGHTS_S = replace(LEAN_S, encoder_blocks=(0, 0), middle_blocks=3)
LEAN_M = LeanConfig(widths=(32, 32, 48, 64), encoder_blocks=(1, 1, 1), decoder_blocks=(1, 1, 1))
LEAN_L = LeanConfig(widths=(48, 48, 64, 96), encoder_blocks=(1, 1, 1), decoder_blocks=(1, 1, 1))
LIGHTS_M = replace(LEAN_M, encoder_blocks=(1, 0, 0))


def _conv(inputs: int, outputs: int, size: int, stride: int, *, bias: bool) -> nn.Conv2d:
    padding = (size - stride + 1) // 2
    conv = nn.Conv2d(inputs, outputs, size, stride, padding, bias=bias)
    nn.init.kaiming_normal_(conv.weight, a=NEGATIVE_SLOPE, nonlinearity="leaky_relu")
    if conv.bias is not None:
        nn.init.zeros_(conv.bias)
    return conv


class ResidualBlock(nn.Module):
    """x + conv(leaky_relu(conv(x))), both 3x3."""

    def __init__(self, channels: int, *, bias: bool) -> None:
        super().__init__()
        self.first = _conv(channels, channels, 3, 1, bias=bias)
        self.second = _conv(channels, channels, 3, 1, bias=bias)
        with torch.no_grad():
            self.second.weight.mul_(BRANCH_GAIN)

    def forward(self, x: Tensor) -> Tensor:
        """Return (b, c, h, w) from (b, c, h, w)."""
        branch = nn.functional.leaky_relu(self.first(x), NEGATIVE_SLOPE)
        return x + torch.as_tensor(self.second(branch))


class Upsampling(nn.Module):
    """Twice the size by a 1x1 convolution and a pixel-shuffle."""

    def __init__(self, inputs: int, outputs: int, *, bias: bool) -> None:
        super().__init__()
        self.conv = _conv(inputs, 4 * outputs, 1, 1, bias=bias)

    def forward(self, x: Tensor) -> Tensor:
        """Return (b, outputs, 2h, 2w) from (b, inputs, h, w)."""
        return nn.functional.pixel_shuffle(self.conv(x), 2)


def _blocks(count: int, channels: int, *, bias: bool) -> nn.Sequential:
    return nn.Sequential(*(ResidualBlock(channels, bias=bias) for _ in range(count)))


class LeanUnet(nn.Module):
    """The CPU-first family; a new network returns its last three input planes unchanged."""

    def __init__(self, config: LeanConfig) -> None:
        super().__init__()
        self.config = config
        self.in_channels = config.in_channels
        self.stride_px = 2 ** len(config.widths)
        widths, bias = config.widths, config.bias
        pairs = list(pairwise(widths))
        self.head = _conv(config.in_channels, widths[0], 6, 2, bias=bias)
        self.encoders = nn.ModuleList(
            _blocks(n, w, bias=bias)
            for n, w in zip(config.encoder_blocks, widths[:-1], strict=True)
        )
        self.downs = nn.ModuleList(_conv(a, b, 2, 2, bias=bias) for a, b in pairs)
        self.middle = _blocks(config.middle_blocks, widths[-1], bias=bias)
        self.ups = nn.ModuleList(Upsampling(b, a, bias=bias) for a, b in pairs)
        self.decoders = nn.ModuleList(
            _blocks(n, w, bias=bias)
            for n, w in zip(config.decoder_blocks, widths[:-1], strict=True)
        )
        self.tail = _conv(widths[0], 12, 3, 1, bias=bias)
        nn.init.zeros_(self.tail.weight)

    def forward(self, planes: Tensor) -> Tensor:
        """Restore the last three planes.

        Args:
            planes: (b, in_channels, h, w) float32, stabilised; h, w multiples of `stride_px`.

        Returns:
            (b, 3, h, w) float32, stabilised.
        """
        x = nn.functional.leaky_relu(self.head(planes), NEGATIVE_SLOPE)
        skips = []
        for encoder, halving in zip(self.encoders, self.downs, strict=True):
            x = encoder(x)
            skips.append(x)
            x = nn.functional.leaky_relu(halving(x), NEGATIVE_SLOPE)
        x = self.middle(x)
        for i in reversed(range(len(skips))):
            x = self.decoders[i](self.ups[i](x) + skips[i])
        return planes[:, -3:] + nn.functional.pixel_shuffle(self.tail(x), 2)
