"""Fabrication of a height map by etching: levels, wrapping, errors of depth, masks.

A plate of 2^n levels is etched n times, through one binary mask each, to depths of 1, 2, 4, ...
steps. Where a mask etches too deep, all its cells do.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class Etching:
    """The etching of a plate.

    Attributes:
        range_um: Height range of the levels.
        levels: 2, 4, 8, ...
        wraps: Heights are taken modulo the range, which is a cycle of the design wavelength then;
            the level above the highest is the lowest. Else they are moved to begin at 0, what is
            higher than the range is cut.
    """

    range_um: float
    levels: int = 16
    wraps: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot be etched.

        Raises:
            ContractError: If so.
        """
        if not 0 < self.range_um < math.inf:
            raise ContractError(f"range_um must be > 0; got {self.range_um}")
        if self.levels < 2 or self.levels & (self.levels - 1):
            raise ContractError(f"levels are 2, 4, 8, ...; got {self.levels}")

    @property
    def masks(self) -> int:
        """Return the number of masks."""
        return self.levels.bit_length() - 1

    @property
    def step_um(self) -> float:
        """Return the height of a level."""
        return self.range_um / (self.levels if self.wraps else self.levels - 1)

    def level(self, height_um: Tensor) -> Tensor:
        """Return the level of every cell.

        Args:
            height_um: (cells, cells), heights in um.

        Returns:
            (cells, cells) int64, indices 0 .. levels - 1.

        Raises:
            ContractError: If a height is not finite.
        """
        if not bool(torch.isfinite(height_um).all()):
            raise ContractError("a height is not a finite number")
        if self.wraps:
            return torch.remainder(torch.round(height_um / self.step_um), self.levels).long()
        raised = height_um - height_um.min()
        return torch.round(raised / self.step_um).clamp(0, self.levels - 1).long()

    def etched(self, height_um: Tensor, depth_errors: Sequence[float] = ()) -> Tensor:
        """Return the heights as etched; gradients flow as if nothing had been rounded.

        Args:
            height_um: (cells, cells), heights in um as designed.
            depth_errors: (mask,), share by which each mask etches too deep; none if empty.

        Returns:
            (cells, cells), heights in um.

        Raises:
            ContractError: If a height is not finite, or there is not one error a mask.
        """
        errors = tuple(depth_errors) or (0.0,) * self.masks
        if len(errors) != self.masks:
            raise ContractError(f"{self.masks} masks want {self.masks} errors; got {len(errors)}")
        bits = mask_layers(self.level(height_um.detach()), self.levels).to(height_um.dtype)
        depths = [self.step_um * 2**k * (1 + error) for k, error in enumerate(errors)]
        relief = torch.einsum("k,khw->hw", torch.tensor(depths, dtype=height_um.dtype), bits)
        return height_um + (relief - height_um).detach()


def mask_layers(level: Tensor, levels: int) -> Tensor:
    """Return masks (mask, cells, cells) of levels: True where the mask of depth 2^k leaves glass.

    The first one is that of a single step.
    """
    count = levels.bit_length() - 1
    return torch.stack([(level >> k) & 1 for k in range(count)]).bool()
