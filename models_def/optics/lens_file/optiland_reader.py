"""A JSON file of optiland (its centred, refracting part) as a `Lens`."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from camkit.errors import DecodeError, UnsupportedError
from camkit.models_def.optics.glass.catalogue import GlassCatalogue, own_glass
from camkit.models_def.optics.glass.material import Glass
from camkit.models_def.optics.lens_file.json_table import (
    Table,
    finite_at,
    number_at,
    numbers_at,
    table_at,
    tables_at,
    text_at,
)
from camkit.models_def.optics.lens_file.optiland_glass import read_glass_table
from camkit.models_def.optics.lens_file.placing import with_object_na
from camkit.models_def.optics.lens_file.wavelength_weights import weighted_waves
from camkit.models_def.optics.lens_file.zmx_field import FieldType, with_field_points
from camkit.models_def.optics.prescription import ApertureKind, Lens, Surface
from camkit.models_def.optics.shape.polynomial import without_last_zeros

KEY: Final = "surface_group"
"""By which a file of optiland is known."""
_TYPES: Final = ("Plane", "StandardGeometry", "EvenAsphere")
_FIELDS: Final = {
    "AngleField": FieldType.ANGLE,
    "angle": FieldType.ANGLE,
    "ObjectHeightField": FieldType.OBJECT_HEIGHT,
    "object_height": FieldType.OBJECT_HEIGHT,
    "ParaxialImageHeightField": FieldType.PARAXIAL_IMAGE_HEIGHT,
    "paraxial_image_height": FieldType.PARAXIAL_IMAGE_HEIGHT,
    "RealImageHeightField": FieldType.REAL_IMAGE_HEIGHT,
    "real_image_height": FieldType.REAL_IMAGE_HEIGHT,
}
_APERTURES: Final[dict[str, ApertureKind]] = {
    "EPD": "entrance_pupil_diameter_mm",
    "imageFNO": "f_number",
    "float_by_stop_size": "stop_semi_diameter_mm",
}
_UM_PER_UNIT: Final = {"nm": 1e-3, "um": 1.0, "mm": 1e3, "cm": 1e4, "m": 1e6}
_SAME_MM: Final = 1e-9


def parse_optiland(
    table: Table,
    catalogues: Sequence[GlassCatalogue] = (),
    preferred: Sequence[GlassCatalogue] = (),
    *,
    name: str = "lens",
) -> tuple[Lens, tuple[str, ...]]:
    """Read a lens from the JSON object of an optiland file; lengths are taken as mm.

    Args:
        table: The file.
        catalogues: Of the user; asked for glasses first.
        preferred: Those of camkit that are asked first for a name without catalogue.
        name: Of the lens, where the file has none.

    Returns:
        The lens, and what of its file it does not carry.

    Raises:
        DecodeError: If the file is damaged.
        UnsupportedError: If it holds what camkit does not trace; the message names it.
        ContractError: If a glass is unknown or the lens makes no sense.
    """
    blocks = tables_at(table_at(table, KEY, "the file"), "surfaces", KEY)
    if len(blocks) < 3:
        raise DecodeError(f"object, lens and image were expected; got {len(blocks)} surfaces")
    heights = [_height_mm(block, i) for i, block in enumerate(blocks)]
    glasses = [
        _glass(block, f"surface {i}", catalogues, preferred) for i, block in enumerate(blocks[:-1])
    ]
    surfaces = tuple(
        _surface(blocks[i], i, heights[i + 1] - heights[i], glasses[i], catalogues)
        for i in range(1, len(blocks) - 1)
    )
    _refuse(blocks[-1], len(blocks) - 1)
    if math.isfinite(_radius(blocks[-1], "the image")):
        raise UnsupportedError("the image is curved; a sensor is flat")
    stops = [i for i, block in enumerate(blocks[1:-1]) if block.get("is_stop") is True]
    if len(stops) != 1:
        raise DecodeError(f"one surface of the lens must be the stop; got {stops or 'none'}")
    waves, reference, wave_notes = _wavelengths(table_at(table, "wavelengths", "the file"))
    lens = Lens(
        name=text_at(table, "name") or name,
        note=text_at(table, "note"),
        surfaces=surfaces,
        stop=stops[0],
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=1.0,
        object_distance_mm=_object_distance_mm(heights),
        wavelengths_um=waves,
        reference_wavelength_um=reference,
        object_glass=glasses[0].name,
        object_material=own_glass(glasses[0], catalogues) or _file_glass(glasses[0]),
    )
    lens = _with_aperture(lens, table_at(table, "aperture", "the file"))
    fields = table_at(table, "fields", "the file")
    lens, field_notes = _with_fields(lens, fields)
    return lens, (*_notes(table, fields), *wave_notes, *field_notes)


def _file_glass(glass: Glass) -> Glass | None:
    """Return a glass whose coefficients only the file has."""
    return glass if glass.name.endswith("-optiland") else None


def _glass(
    block: Table,
    where: str,
    catalogues: Sequence[GlassCatalogue],
    preferred: Sequence[GlassCatalogue],
) -> Glass:
    material = table_at(block, "material_post", where)
    return read_glass_table(material, text_at(block, "comment"), where, catalogues, preferred)


def _height_mm(block: Table, number: int) -> float:
    """Return where a surface stands along the axis, or refuse one that is not on it."""
    where = f"surface {number}"
    place = table_at(table_at(block, "geometry", where), "cs", where)
    if any(number_at(place, key, where, 0.0) for key in ("x", "y", "rx", "ry")):
        raise UnsupportedError(f"{where} is tilted or decentred; camkit traces centred lenses")
    return number_at(place, "z", where)


def _object_distance_mm(heights: list[float]) -> float:
    distance_mm = heights[1] - heights[0]
    if not distance_mm > 0:
        raise UnsupportedError(f"the object lies {distance_mm:g} mm in front of the lens")
    return distance_mm


def _thickness_mm(block: Table, gap_mm: float, number: int) -> float:
    """Return the thickness after a surface: that of its key, if the places do not contradict it."""
    stated_mm = number_at(block, "thickness", f"surface {number}", gap_mm)
    if not math.isfinite(gap_mm):
        raise DecodeError(f"surface {number} must have a finite place; got {gap_mm}")
    return stated_mm if abs(stated_mm - gap_mm) <= _SAME_MM * (1 + abs(gap_mm)) else gap_mm


def _refuse(block: Table, number: int) -> None:
    """Refuse a surface that camkit does not trace, by name."""
    where = f"surface {number}"
    geometry = table_at(block, "geometry", where)
    model = table_at(block, "interaction_model", where)
    kind, way = text_at(geometry, "type"), text_at(model, "type")
    if kind not in _TYPES:
        raise UnsupportedError(f"{where} is of type {kind}; camkit reads {', '.join(_TYPES)}")
    if model.get("is_reflective") is True:
        raise UnsupportedError(f"{where} is a mirror; camkit traces lenses only")
    if way not in ("", "RefractiveReflectiveModel"):
        raise UnsupportedError(f"{where} has a {way}; camkit refracts")


def _surface(
    block: Table, number: int, gap_mm: float, glass: Glass, catalogues: Sequence[GlassCatalogue]
) -> Surface:
    _refuse(block, number)
    where = f"surface {number}"
    geometry = table_at(block, "geometry", where)
    terms = without_last_zeros(numbers_at(geometry, "coefficients", where))
    return Surface(
        curvature_per_mm=1 / _radius(block, where),
        thickness_mm=_thickness_mm(block, gap_mm, number),
        glass=glass.name,
        material=own_glass(glass, catalogues) or _file_glass(glass),
        semi_diameter_mm=_rim_mm(block, where),
        conic=number_at(geometry, "conic", where, 0.0),
        even_asphere=terms,
    )


def _rim_mm(block: Table, where: str) -> float:
    rim = table_at(block, "aperture", where)
    if not rim:
        return math.inf
    if text_at(rim, "type") != "RadialAperture" or number_at(rim, "r_min", where, 0.0):
        raise UnsupportedError(
            f"{where} has a {text_at(rim, 'type')}; camkit has round ones about the axis"
        )
    return number_at(rim, "r_max", where)


def _radius(block: Table, where: str) -> float:
    radius_mm = number_at(table_at(block, "geometry", where), "radius", where, math.inf)
    if radius_mm == 0:
        raise DecodeError(f"{where}: radius must not be 0 (a plane is Infinity)")
    return radius_mm


def _wavelengths(table: Table) -> tuple[tuple[float, ...], float, tuple[str, ...]]:
    """Return the wavelengths in um, increasing, the primary one, and notes."""
    entries = tables_at(table, "wavelengths", "wavelengths")
    if not entries:
        raise DecodeError("the file states no wavelength")
    waves: dict[float, float] = {}
    reference = None
    for entry in entries:
        unit = text_at(entry, "unit") or "um"
        if unit not in _UM_PER_UNIT:
            raise DecodeError(f"wavelengths: unit must be one of {', '.join(_UM_PER_UNIT)}")
        wave = number_at(entry, "value", "wavelengths") * _UM_PER_UNIT[unit]
        waves[wave] = number_at(entry, "weight", "wavelengths", 1.0)
        reference = wave if entry.get("is_primary") is True else reference
    counted, notes = weighted_waves(waves)
    return counted, next(iter(waves)) if reference is None else reference, notes


def _with_aperture(lens: Lens, table: Table) -> Lens:
    kind = text_at(table, "type")
    if not kind:
        size_mm = lens.surfaces[lens.stop].semi_diameter_mm
        if math.isinf(size_mm):
            raise DecodeError("the file states no aperture, and its stop has no rim")
        return replace(lens, aperture_kind="stop_semi_diameter_mm", aperture_value=size_mm)
    value = number_at(table, "value", "aperture")
    if kind == "objectNA":
        return with_object_na(lens, value)
    if kind not in _APERTURES:
        raise UnsupportedError(f"aperture {kind}; camkit reads {', '.join(_APERTURES)}, objectNA")
    half = 0.5 if kind == "float_by_stop_size" else 1.0
    return replace(lens, aperture_kind=_APERTURES[kind], aperture_value=half * value)


def _with_fields(lens: Lens, table: Table) -> tuple[Lens, tuple[str, ...]]:
    if table.get("telecentric") is True:
        raise UnsupportedError(
            "the object space is telecentric; camkit sends chief rays through the stop"
        )
    definition = table_at(table, "field_definition", "fields")
    kind = text_at(definition, "field_type") or text_at(table, "field_type") or "AngleField"
    if kind not in _FIELDS:
        raise UnsupportedError(f"fields are of kind {kind}; camkit reads {', '.join(_FIELDS)}")
    points = [
        (finite_at(entry, "x", "fields", 0.0), finite_at(entry, "y", "fields", 0.0))
        for entry in tables_at(table, "fields", "fields")
    ]
    return with_field_points(lens, _FIELDS[kind], points or [(0.0, 0.0)])


def _notes(table: Table, fields: Table) -> tuple[str, ...]:
    notes = []
    entries = tables_at(fields, "fields", "fields")
    if any(number_at(entry, key, "fields", 0.0) for entry in entries for key in ("vx", "vy")):
        notes.append("vignetting factors left out: only rims vignette")
    solves = table_at(table, "solves", "the file").get("solves")
    for key, value in (("apodization", table.get("apodization")), ("solves", solves)):
        if value:
            notes.append(f"{key} left out")
    if table.get("pickups"):
        notes.append("pickups left out: the values are those of the file")
    return tuple(notes)
