"""The generator of the thin-plate camera (chapter 3), with the instance norms that it has.

    /1   3x3, act, 4x4 /2 ------------------------------ act, up, 3x3, act, 3x3 -- (+ input)
    /2     act, 4x4 /2, norm ----- concat -- act, up, 3x3, norm
    ...      ...                               ...
    /32        act, 4x4 /2, norm - act, up, 3x3, norm
    /64

Every stage halves with a 4x4 convolution and doubles with the nearest neighbour and a 3x3 one; what
a stage is given is concatenated to what it gives. Where the text and the public code of the authors
(Peng, Sun et al. 2019) differ, this is the code: six stages for the text's seven (the code is told
seven and nests six), PReLUs for its LeakyReLUs and ReLUs, a 3x3 convolution in front for its 4x4,
no skip at full size but the residual. Norms have no gain and offset.
PReLUs have a slope each, where the code shares one per stage; the hyperbolic tangent and the clamp
at the end are left out, since stabilised light has no upper end.

The thesis gives its generator the capture alone; behind a Wiener bank it may see both.

References: Sun 2021, section 3.5.2 and figure 3.5; Isola et al. 2017.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.networks.instance_norm import picture_norm

COLOURS: Final = 3
MOST_GROWTH: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class NormedConfig:
    """Shape of a `NormedUnet`.

    Attributes:
        width: Channels of the first stage; they double per stage, up to 8 times. The thesis has
            64, a CPU trains 16.
        stages: How often the size is halved.
        in_channels: 6 (capture and Wiener planes) or 3 (one picture).
        capture_only: Whether of six planes the capture alone is looked at, as in the thesis.
        residual: Whether the output is added to the last three planes that are looked at.
        frozen: Whether norms have constants, see `freeze_norms`.
    """

    width: int = 64
    stages: int = 6
    in_channels: int = 6
    capture_only: bool = False
    residual: bool = True
    frozen: bool = False

    def __post_init__(self) -> None:
        if self.width < 1 or self.stages < 2:
            raise ContractError(
                f"the generator needs width >= 1 and stages >= 2; got {self.width}, {self.stages}"
            )
        if self.in_channels not in (COLOURS, 2 * COLOURS):
            raise ContractError(f"in_channels must be 3 or 6; got {self.in_channels}")

    @property
    def widths(self) -> tuple[int, ...]:
        """Channels at /2, /4, ..."""
        return tuple(self.width * min(2**i, MOST_GROWTH) for i in range(self.stages))


class NormedUnet(nn.Module):
    """The generator; a new one with `residual` gives the planes it would correct."""

    def __init__(self, config: NormedConfig | None = None) -> None:
        super().__init__()
        self.config = config or NormedConfig()
        self.in_channels = self.config.in_channels
        self.stride_px = 2**self.config.stages
        widths, frozen = self.config.widths, self.config.frozen
        first, pairs = widths[0], list(pairwise(widths))
        inputs = COLOURS if self.config.capture_only else self.in_channels
        self.head = nn.Sequential(_conv(inputs, first, 3), nn.PReLU(), _halving(first, first))
        self.downs = nn.ModuleList(
            nn.Sequential(nn.PReLU(), _halving(a, b), picture_norm(b, frozen=frozen))
            for a, b in pairs
        )
        # The innermost stage is given no skip of its own.
        depths = [2 * b for _, b in pairs[:-1]] + [widths[-1]]
        self.ups = nn.ModuleList(
            nn.Sequential(nn.PReLU(), _doubling(n, a), picture_norm(a, frozen=frozen))
            for n, (a, _) in zip(depths, pairs, strict=True)
        )
        self.tail = nn.Sequential(
            nn.PReLU(), _doubling(2 * first, first), nn.PReLU(), _conv(first, COLOURS, 3)
        )
        if self.config.residual:
            nn.init.zeros_(torch.as_tensor(self.tail[-1].weight))
            nn.init.zeros_(torch.as_tensor(self.tail[-1].bias))

    def forward(self, planes: Tensor) -> Tensor:
        """Restore three planes.

        Args:
            planes: (b, in_channels, h, w) float32, stabilised; h, w multiples of `stride_px`.

        Returns:
            (b, 3, h, w) float32, stabilised.
        """
        inputs = planes[:, :COLOURS] if self.config.capture_only else planes
        x = self.head(inputs)
        skips = []
        for halving in self.downs:
            skips.append(x)
            x = halving(x)
        for i in reversed(range(len(skips))):
            x = torch.cat((self.ups[i](x), skips[i]), dim=1)
        restored: Tensor = self.tail(x)
        return inputs[:, -COLOURS:] + restored if self.config.residual else restored


def _conv(inputs: int, outputs: int, size: int) -> nn.Conv2d:
    return nn.Conv2d(inputs, outputs, size, padding=size // 2)


def _halving(inputs: int, outputs: int) -> nn.Conv2d:
    return nn.Conv2d(inputs, outputs, 4, stride=2, padding=1)


def _doubling(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Upsample(scale_factor=2, mode="nearest"), _conv(inputs, outputs, 3))
