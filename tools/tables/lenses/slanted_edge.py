"""Contrast of what is recovered, measured on a slanted edge: a network has no kernel to transform.

A sharp edge, slanted so that every position within a pixel occurs, is photographed and recovered.
The spectrum of its profile (`camkit.report.edge_profile`), where the edge is known to lie, divided
by the same of the sharp edge, is the contrast, free of pixel and method.
Not scaled to 1 at frequency 0: light that was spread wider than the window counts as lost.

References: ISO 12233 (the slanted edge).
"""

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.errors import ContractError
from camkit.report.edge_profile import edge_waves, sort_samples

Across = Literal["tangential", "sagittal"]
ACROSS: Final[tuple[Across, ...]] = get_args(Across)

# 3.5 degrees; simple fractions repeat the same few positions within a pixel
SLANT: Final = 0.0618
LEVELS: Final = (0.15, 0.6)
_FINE: Final = 8
_RISE: Final = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeContrast:
    """Contrast at frequencies.

    Attributes:
        cycles_per_px: (frequency,), increasing.
        contrast: (..., frequency).
    """

    cycles_per_px: Tensor
    contrast: Tensor

    @property
    def largest(self) -> Tensor:
        """(...), over all frequencies."""
        return self.contrast.amax(-1)

    @property
    def rise(self) -> Tensor:
        """(...), how far the contrast climbs again above what a lower frequency had."""
        return (self.contrast - self.contrast.cummin(-1).values).amax(-1)

    @property
    def falls(self) -> Tensor:
        """(...), whether it never climbs again by more than 0.02."""
        return self.rise <= _RISE


def slanted_edge(side_px: int, across: Across, levels: tuple[float, float] = LEVELS) -> Tensor:
    """Return a linear picture (3, side, side) of an edge through its middle, dark to bright.

    Args:
        side_px: Of the picture.
        across: `tangential`: the level changes along the rows' direction of counting (y, the
            field's direction); `sagittal`: along x.
        levels: Linear, of the dark and the bright side.
    """
    fine = (torch.arange(side_px * _FINE, dtype=torch.float64) + 0.5) / _FINE - side_px / 2
    bright = (_distance(fine[:, None], fine[None], across) > 0).to(torch.float64)
    share = bright.reshape(side_px, _FINE, side_px, _FINE).mean((1, 3))
    low, high = levels
    return (low + (high - low) * share).expand(3, -1, -1).contiguous()


def _distance(y: Tensor, x: Tensor, across: Across) -> Tensor:
    along, beside = (y, x) if across == "tangential" else (x, y)
    return (along + SLANT * beside) / math.hypot(1, SLANT)


def edge_contrast(
    pictures: Tensor, sharp: Tensor, across: Across, *, reach_px: int = 40, count: int = 25
) -> EdgeContrast:
    """Return the contrast of recovered edges.

    Args:
        pictures: (..., h, w) linear, h = w.
        sharp: (h, w), the part of `slanted_edge` that they show, the edge through its middle.
        across: Of the edge.
        reach_px: How far from the edge it is looked at, each way.
        count: Frequencies up to half a cycle per pixel.

    Raises:
        ContractError: If the pictures are smaller than the reach.
    """
    side = sharp.shape[-1]
    if side < 2 * reach_px + 4 or sharp.shape != (side, side):
        raise ContractError(
            f"edges need square pictures of at least {2 * reach_px + 4} px; got {list(sharp.shape)}"
        )
    place = torch.arange(side, dtype=torch.float64) + 0.5 - side / 2
    bins = sort_samples(_distance(place[:, None], place[None], across).numpy(), reach_px)
    cycles = torch.linspace(0.5 / count, 0.5, count, dtype=torch.float64)
    waves = edge_waves(bins, cycles.numpy())

    def spectrum(values: Tensor) -> NDArray[np.float64]:
        planes = values.detach().numpy().reshape(-1, side, side)
        return np.abs(np.stack([waves @ bins.means(plane) for plane in planes]))

    contrast = torch.from_numpy(spectrum(pictures) / spectrum(sharp))
    return EdgeContrast(
        cycles_per_px=cycles, contrast=contrast.reshape(*pictures.shape[:-2], count)
    )
