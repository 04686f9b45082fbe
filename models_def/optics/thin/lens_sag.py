"""The sag of every surface of a lens in one table."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Final

from camkit.models_def.optics.analysis.first_order import paraxial_rays
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.thin.sag_table import sag_table
from camkit.units import UM_PER_MM

ROWS: Final = 100
"""Steps from the axis to the rim."""


def write_lens_sag(lens: Lens, path: Path) -> tuple[str, ...]:
    """Write surface, radius_mm, height_um and slope as CSV.

    A surface without a rim ends where the paraxial beam of the widest field does.

    Args:
        lens: Any.
        path: The file.

    Returns:
        Notes on surfaces that have no rim.

    Raises:
        ContractError: If a surface ends before its rim.
    """
    rays = paraxial_rays(lens, math.tan(max(lens.field_angles_rad)))
    reach_mm = (rays.marginal.height_mm.abs() + rays.chief.height_mm.abs()).tolist()
    lines, without_rim = ["surface,radius_mm,height_um,slope"], []
    for number, surface in enumerate(lens.surfaces):
        face = surface
        if math.isinf(surface.semi_diameter_mm):
            without_rim.append(f"{number} ({reach_mm[number]:.4g} mm)")
            face = replace(surface, semi_diameter_mm=reach_mm[number])
        table = sag_table(face, face.semi_diameter_mm * UM_PER_MM / ROWS)
        rows = zip(table.radius_mm, table.height_um, table.slope, strict=True)
        lines += [f"{number},{r:.6f},{h:.5f},{s:.8f}" for r, h, s in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if not without_rim:
        return ()
    surfaces = ", ".join(without_rim)
    return (f"no rim: the table ends where the paraxial beam does, surfaces {surfaces}",)
