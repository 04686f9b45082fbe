"""A `Lens` as the JSON file of optiland, in which its function load_optiland_file finds it."""

import json
import math
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.configuration.exact_text import degrees_text
from camkit.models_def.optics.glass.catalogue import AIR
from camkit.models_def.optics.lens_file.optiland_glass import COMMENT, glass_table
from camkit.models_def.optics.prescription import Lens, Surface, require_plain

_APERTURES: Final = {
    "f_number": "imageFNO",
    "entrance_pupil_diameter_mm": "EPD",
    "stop_semi_diameter_mm": "float_by_stop_size",
}
_UPRIGHT: Final = {"x": 0.0, "y": 0.0, "rx": 0.0, "ry": 0.0, "rz": 0.0, "reference_cs": None}
_REFRACTION: Final = {
    "type": "RefractiveReflectiveModel",
    "is_reflective": False,
    "coating": None,
    "bsdf": None,
}
_PARTS: Final = frozenset(
    {
        *("curvature_per_mm", "conic", "even_asphere", "thickness_mm", "semi_diameter_mm"),
        *("glass", "material", "index_offset", "vary"),
    }
)
"""Of a surface: written, or known to stay behind. Any other part is an error where it is set."""
_NEWTON: Final = {"tol": 1e-10, "max_iter": 100}


def write_optiland(lens: Lens, path: Path) -> None:
    """Write a lens as optiland's JSON.

    Raises:
        UnsupportedError: If a surface has grooves.
        ContractError: If the lens is a fabricated copy (index offsets are not written).
    """
    path.write_text(json.dumps(optiland_table(lens), indent=1) + "\n", encoding="utf-8")


def optiland_table(lens: Lens) -> dict[str, Any]:
    """Return the JSON object of a lens; see `write_optiland`."""
    if any(surface.index_offset for surface in lens.surfaces):
        raise ContractError("a lens file holds no index offsets; write the nominal lens")
    require_plain(lens, "optiland's JSON")
    waves = dict.fromkeys((*lens.wavelengths_um, lens.reference_wavelength_um))
    surfaces, z_mm = [_object_table(lens)], 0.0
    for i, surface in enumerate(lens.surfaces):
        surfaces.append(_surface_table(lens, surface, i, z_mm))
        z_mm += surface.thickness_mm
    surfaces.append(_table(_plane(z_mm), lens, lens.surfaces[-1], thickness=0.0))
    near = math.isfinite(lens.object_distance_mm)
    kind = "ObjectHeightField" if near else "AngleField"
    value = lens.aperture_value
    is_stop = lens.aperture_kind == "stop_semi_diameter_mm"
    return {
        "version": 1.0,
        "name": lens.name,
        "note": lens.note,
        "aperture": {
            "type": _APERTURES[lens.aperture_kind],
            "value": 2 * value if is_stop else value,
        },
        "fields": {
            "fields": [
                {"x": 0.0, "y": _field(lens, angle), "vx": 0.0, "vy": 0.0, "weight": 1.0}
                for angle in lens.field_angles_rad
            ],
            "telecentric": False,
            "field_definition": {"field_type": kind},
        },
        "wavelengths": {
            "wavelengths": [
                {
                    "value": wave,
                    "is_primary": wave == lens.reference_wavelength_um,
                    "unit": "um",
                    # a reference that is none of the wavelengths of interest has weight 0
                    "weight": 1.0 if wave in lens.wavelengths_um else 0.0,
                }
                for wave in waves
            ],
            "polarization": "ignore",
        },
        "apodization": None,
        "pickups": [],
        "solves": {"solves": []},
        "surface_group": {"surfaces": surfaces},
    }


def _field(lens: Lens, angle_rad: float) -> float:
    if math.isinf(lens.object_distance_mm):
        return float(degrees_text(angle_rad))
    return math.tan(angle_rad) * lens.object_distance_mm


def _plane(z_mm: float) -> dict[str, Any]:
    return {"type": "Plane", "cs": {**_UPRIGHT, "z": z_mm}, "radius": math.inf}


def _object_table(lens: Lens) -> dict[str, Any]:
    waves = (*lens.wavelengths_um, lens.reference_wavelength_um)
    is_air = lens.object_glass == AIR.name
    return {
        "type": "ObjectSurface",
        "geometry": _plane(-lens.object_distance_mm),
        "material_post": glass_table(lens.object_medium, waves),
        "comment": "" if is_air else f"{COMMENT}{lens.object_glass}",
    }


def _surface_table(lens: Lens, surface: Surface, number: int, z_mm: float) -> dict[str, Any]:
    for part in fields(surface):
        if part.name not in _PARTS and getattr(surface, part.name) != part.default:
            raise UnsupportedError(
                f"surface {number} has {part.name}, which a file of optiland does not carry here; "
                "write .toml"
            )
    geometry = _plane(z_mm)
    if surface.even_asphere or surface.curvature_per_mm:
        geometry |= {"type": "StandardGeometry", "radius": surface.radius_mm}
        geometry["conic"] = surface.conic
    if surface.even_asphere:
        geometry |= {"type": "EvenAsphere", "coefficients": list(surface.even_asphere), **_NEWTON}
    table = _table(geometry, lens, surface, thickness=surface.thickness_mm)
    rim_mm = surface.semi_diameter_mm
    if math.isfinite(rim_mm):
        table["aperture"] = {"type": "RadialAperture", "r_max": rim_mm, "r_min": 0.0}
    return table | {"is_stop": number == lens.stop}


def _table(
    geometry: dict[str, Any], lens: Lens, surface: Surface, *, thickness: float
) -> dict[str, Any]:
    waves = (*lens.wavelengths_um, lens.reference_wavelength_um)
    is_air = surface.glass == AIR.name
    return {
        "type": "Surface",
        "thickness": thickness,
        "geometry": geometry,
        "material_post": glass_table(surface.medium, waves),
        "is_stop": False,
        "aperture": None,
        "comment": "" if is_air else f"{COMMENT}{surface.glass}",
        "interaction_model": dict(_REFRACTION),
    }
