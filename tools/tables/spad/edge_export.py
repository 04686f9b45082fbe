"""Bicubic interpolation for graphs of bundles, which know no padding but zeros.

    picture -- two zeros around -- each empty place next to a full one takes its value, twice --

along rows, then along columns: the outermost samples go on, as `Bicubic` has them.
"""

from typing import Final

import torch
from torch import Tensor, nn
from torch.nn import functional

from camkit.models_def.networks.bicubic import REACH, Bicubic

NEIGHBOURS: Final = (1.0, 0.0, 1.0)


class PlainBicubic(nn.Module):
    """A `Bicubic` made of convolutions, products and sums alone."""

    filters: Tensor
    around: Tensor

    def __init__(self, finer: Bicubic, channels: int) -> None:
        super().__init__()
        self.scale, self.channels = finer.scale, channels
        self.register_buffer("filters", finer.filters.repeat(channels, 1, 1, 1), persistent=False)
        around = torch.tensor(NEIGHBOURS).reshape(1, 1, 1, 3).repeat(channels, 1, 1, 1)
        self.register_buffer("around", around, persistent=False)

    def forward(self, samples: Tensor) -> Tensor:
        """Return (b, c, scale h, scale w) from (b, c, h, w)."""
        wide = self._grown(samples, (0, 1))
        wide = self._grown(wide, (1, 0))
        fine = functional.conv2d(wide, self.filters, groups=self.channels)
        return functional.pixel_shuffle(fine, self.scale)

    def _grown(self, values: Tensor, axis: tuple[int, int]) -> Tensor:
        """Let a picture go on by `REACH` samples at both ends of an axis."""
        by = (REACH * axis[0], REACH * axis[1])
        same = torch.ones(self.channels, 1, 1, 1)
        full = functional.conv2d(values * 0 + 1, same, padding=by, groups=self.channels)
        wide = functional.conv2d(values, same, padding=by, groups=self.channels)
        around = self.around if axis == (0, 1) else self.around.transpose(2, 3)
        for _ in range(REACH):
            empty = 1 - full
            wide = wide + empty * self._beside(wide, around, axis)
            full = full + empty * self._beside(full, around, axis)
        return wide

    def _beside(self, values: Tensor, around: Tensor, axis: tuple[int, int]) -> Tensor:
        return functional.conv2d(values, around, padding=axis, groups=self.channels)


def with_plain_borders(network: nn.Module) -> nn.Module:
    """Let a network that begins with a `Bicubic` begin with a plain one; others stay."""
    finer = getattr(network, "finer", None)
    if isinstance(finer, Bicubic):
        network.finer = PlainBicubic(finer, network.in_channels)  # type: ignore[arg-type]
    return network
