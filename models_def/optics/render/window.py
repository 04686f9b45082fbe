"""The part of a sensor that is rendered."""

from dataclasses import dataclass
from math import hypot

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.units import UM_PER_MM


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Pixels of a sensor; rows go towards +y, columns towards +x.

    Attributes:
        height_px: Rows.
        width_px: Columns.
        pitch_um: Pixel pitch.
        top_mm: y of the centre of row 0, from the optical axis.
        left_mm: x of the centre of column 0, from the optical axis.
    """

    height_px: int
    width_px: int
    pitch_um: float
    top_mm: float
    left_mm: float

    def __post_init__(self) -> None:
        if self.height_px < 1 or self.width_px < 1:
            raise ContractError(f"a window needs pixels; got {self.height_px} x {self.width_px}")
        if not self.pitch_um > 0:
            raise ContractError(f"pitch_um must be > 0; got {self.pitch_um}")

    @property
    def pitch_mm(self) -> float:
        """Pixel pitch in mm."""
        return self.pitch_um / UM_PER_MM

    @property
    def radius_mm(self) -> float:
        """Distance of the farthest corner of its pixels from the axis."""
        half = self.pitch_mm / 2
        bottom = self.top_mm + (self.height_px - 1) * self.pitch_mm
        right = self.left_mm + (self.width_px - 1) * self.pitch_mm
        y = max(abs(self.top_mm - half), abs(bottom + half))
        return hypot(y, max(abs(self.left_mm - half), abs(right + half)))

    def centres_mm(self) -> tuple[Tensor, Tensor]:
        """Return y (h,) and x (w,) of the pixel centres, float64."""
        rows = torch.arange(self.height_px, dtype=torch.float64)
        columns = torch.arange(self.width_px, dtype=torch.float64)
        return self.top_mm + rows * self.pitch_mm, self.left_mm + columns * self.pitch_mm


def corner_window(height_px: int, width_px: int, pitch_um: float) -> Window:
    """Return a window whose first corner lies on the axis: one quadrant of a sensor."""
    half_mm = pitch_um / UM_PER_MM / 2
    return Window(
        height_px=height_px,
        width_px=width_px,
        pitch_um=pitch_um,
        top_mm=half_mm,
        left_mm=half_mm,
    )
