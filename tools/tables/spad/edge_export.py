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
    near_taps: Tensor

    def __init__(self, finer: Bicubic, channels: int) -> None:
        super().__init__()
        self.scale, self.channels = finer.scale, channels
        self.register_buffer("filters", finer.filters.repeat(channels, 1, 1, 1), persistent=False)
        near_taps = torch.tensor(NEIGHBOURS).reshape(1, 1, 1, 3).repeat(channels, 1, 1, 1)
        self.register_buffer("near_taps", near_taps, persistent=False)

    def forward(self, samples: Tensor) -> Tensor:
        """Return (b, c, scale h, scale w) from (b, c, h, w)."""
        wide = self._extended(samples, (0, 1))
        wide = self._extended(wide, (1, 0))
        fine = functional.conv2d(wide, self.filters, groups=self.channels)
        return functional.pixel_shuffle(fine, self.scale)

    def _extended(self, values: Tensor, axis: tuple[int, int]) -> Tensor:
        """Widen a picture by `REACH` samples at both ends of an axis."""
        padding_px = (REACH * axis[0], REACH * axis[1])
        same = torch.ones(self.channels, 1, 1, 1)
        full = functional.conv2d(values * 0 + 1, same, padding=padding_px, groups=self.channels)
        wide = functional.conv2d(values, same, padding=padding_px, groups=self.channels)
        near_taps = self.near_taps if axis == (0, 1) else self.near_taps.transpose(2, 3)
        for _ in range(REACH):
            empty = 1 - full
            wide = wide + empty * self._neighbours(wide, near_taps, axis)
            full = full + empty * self._neighbours(full, near_taps, axis)
        return wide

    def _neighbours(self, values: Tensor, near_taps: Tensor, axis: tuple[int, int]) -> Tensor:
        return functional.conv2d(values, near_taps, padding=axis, groups=self.channels)


def with_plain_borders(network: nn.Module) -> nn.Module:
    """Return a network whose `Bicubic` at its beginning is a plain one; others stay."""
    finer = getattr(network, "finer", None)
    if isinstance(finer, Bicubic):
        network.finer = PlainBicubic(finer, network.in_channels)  # type: ignore[arg-type]
    return network
