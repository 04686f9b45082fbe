"""The sag of every surface of a lens in one table."""

import math
from collections.abc import Iterable
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
        Notes on surfaces that have no rim, and on what is no height.

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
    notes = not_in_profiles(lens, range(len(lens.surfaces)))
    if not without_rim:
        return notes
    surfaces = ", ".join(without_rim)
    return (*notes, f"no rim: the table ends where the paraxial beam does, surfaces {surfaces}")


def not_in_profiles(lens: Lens, numbers: Iterable[int]) -> tuple[str, ...]:
    """Return what profiles of surfaces do not hold: phases, and how the glass stands."""
    faces = [(str(i), lens.surfaces[i]) for i in numbers]
    phases = ", ".join(i for i, face in faces if face.phase is not None)
    stances = ", ".join(i for i, face in faces if face.stance is not None)
    notes = []
    if phases:
        notes.append(f"the phase of surface {phases} is no height: the table is of the glass below")
    if stances:
        notes.append(
            f"tilt and decentre of surface {stances} stay behind: each profile stands by itself"
        )
    return tuple(notes)
