"""The profile of a surface as a table for the workshop that cuts it."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.optics.grooves import grooved_mm, wall_radii_mm
from camkit.models_def.optics.prescription import Surface
from camkit.units import UM_PER_MM

Array = NDArray[np.float64]
# both sides of a wall are evaluated so far from it
_BESIDE_MM = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SagTable:
    """A profile from the axis to the rim.

    Attributes:
        radius_mm: (row,), a wall has two rows.
        height_um: (row,), of the surface over its vertex plane, along the light, as it is cut.
        slope: (row,), dh/dr.
        walls: How many.
    """

    radius_mm: Array
    height_um: Array
    slope: Array
    walls: int


def sag_table(surface: Surface, step_um: float) -> SagTable:
    """Return the profile of a surface.

    Args:
        surface: With a rim.
        step_um: Of the radius; rim and walls are added.

    Raises:
        ContractError: If the surface has no rim, or ends before it.
    """
    rim_mm = surface.semi_diameter_mm
    if not math.isfinite(rim_mm):
        raise ContractError("a profile needs an end: give the surface a finite semi_diameter_mm")
    if (1 + surface.conic) * surface.curvature_per_mm**2 * rim_mm**2 >= 1:
        raise ContractError(f"the surface ends before its rim of {rim_mm:g} mm")
    radius = torch.arange(math.ceil(rim_mm * UM_PER_MM / step_um), dtype=torch.float64)
    radius = radius * step_um / UM_PER_MM
    walls = torch.zeros(0, dtype=torch.float64)
    if surface.grooves is not None:
        walls = wall_radii_mm(surface.profile, surface.grooves)
        clear = (radius[:, None] - walls).abs() > 2 * _BESIDE_MM
        radius = radius[clear.all(1)]
    end = torch.tensor([rim_mm], dtype=torch.float64)
    radius, _ = torch.cat([radius, walls - _BESIDE_MM, walls + _BESIDE_MM, end]).sort()
    height = surface.profile.height_mm(radius)
    if surface.grooves is not None:
        height = grooved_mm(height, surface.grooves)
    slope = surface.profile.slope(radius)
    return SagTable(
        radius_mm=radius.numpy(),
        height_um=(height * UM_PER_MM).numpy(),
        slope=slope.numpy(),
        walls=len(walls),
    )


def write_sag_table(table: SagTable, path: Path) -> None:
    """Write a table as CSV: radius_mm, height_um, slope."""
    rows = zip(table.radius_mm, table.height_um, table.slope, strict=True)
    lines = ["radius_mm,height_um,slope", *(f"{r:.6f},{h:.5f},{s:.8f}" for r, h, s in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
