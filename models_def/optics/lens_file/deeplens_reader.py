"""A lens file of DeepLens (JSON) as a `Lens`.

Keys as its reader has them: `roc`, else `c`, for the curvature; `d_next`, else the differences of
`d`, for the gaps; `mat2` for the medium behind; `ai` for the terms of r^2, r^4, ... Keys in
parentheses mark what may vary and count like those without. The stored focal length is not
believed. The file names no wavelengths and no fields: those of the sensor are taken.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from camkit.errors import ContractError, DecodeError, UnsupportedError
from camkit.models_def.optics.glass.catalogue import (
    AIR,
    GlassCatalogue,
    catalogues_of,
    find_glass,
    own_glass,
)
from camkit.models_def.optics.glass.dispersion import C_LINE_UM, D_LINE_UM, F_LINE_UM
from camkit.models_def.optics.glass.material import Glass
from camkit.models_def.optics.glass.model_glass import model_glass
from camkit.models_def.optics.lens_file.json_table import (
    Table,
    number_at,
    numbers_at,
    tables_at,
    text_at,
)
from camkit.models_def.optics.lens_file.zmx_glass import GlassOrder, find_zmx_glass
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.shape.polynomial import without_last_zeros

KEY: Final = "surfaces"
"""By which a file of DeepLens is known."""
_STOPS: Final = ("Aperture", "Stop")
_TYPES: Final = (*_STOPS, "Spheric", "Aspheric", "Plane")
_OTHER: Final = ("DOE", "doe", "grating")
_EMPTY: Final = ("", "air", "vacuum", "occluder")
_PLASTICS: Final = {"ps": "POLYSTYR-Misc", "pc": "POLYCARB-Misc", "pmma": "PMMA-Misc"}
_ORDER: Final = ("schott", "cdgm", "misc")
"""In which DeepLens looks for a name."""
_FIRST_ORDER_TOLERANCE: Final = 0.01
_FIELD_SHARES: Final = (0.0, 0.5, 0.7, 1.0)


def parse_deeplens(
    table: Table,
    catalogues: Sequence[GlassCatalogue] = (),
    preferred: Sequence[GlassCatalogue] = (),
    *,
    name: str = "lens",
) -> tuple[Lens, tuple[str, ...]]:
    """Read a lens from the JSON object of a DeepLens file.

    Args:
        table: The file.
        catalogues: Of the user; asked for glasses first.
        preferred: Those of camkit that are asked first.
        name: Of the lens.

    Returns:
        The lens, and what was assumed or left out.

    Raises:
        DecodeError: If the file is damaged.
        UnsupportedError: If it holds what camkit does not trace; the message names it.
        ContractError: If a glass is unknown or the lens makes no sense.
    """
    plain = {key.strip("()"): value for key, value in table.items()}
    for key in _OTHER:
        if plain.get(key):
            raise UnsupportedError(f"{key}: a diffractive element; camkit reads its lens alone")
    blocks = [
        {key.strip("()"): value for key, value in block.items()}
        for block in tables_at(plain, KEY, "the file")
    ]
    sensors = [i for i, block in enumerate(blocks) if text_at(block, "type") == "Sensor"]
    blocks = blocks[: sensors[0]] if sensors else blocks
    if not blocks:
        raise DecodeError("the file has no surface")
    own_order = (c for maker in _ORDER for c in catalogues_of(maker))
    order = GlassOrder(user_catalogues=tuple(catalogues), listed=(*preferred, *own_order))
    places = [number_at(block, "d", f"surface {i}", math.nan) for i, block in enumerate(blocks)]
    places.append(number_at(plain, "d_sensor", "the file", math.nan))
    surfaces = tuple(_surface(block, i, places, order) for i, block in enumerate(blocks))
    stop, notes = _stop(blocks)
    size_mm = number_at(blocks[stop], "r", f"surface {stop}")
    lens = Lens(
        name=name,
        note=text_at(plain, "info"),
        surfaces=surfaces,
        stop=stop,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=size_mm,
        wavelengths_um=(F_LINE_UM, D_LINE_UM, C_LINE_UM),
        reference_wavelength_um=D_LINE_UM,
    )
    data = paraxial_data(lens)
    efl_mm, f_number = data.efl_mm, abs(data.f_number)
    for key, what, value, unit in (
        ("foclen", "a focal length", efl_mm, " mm"),
        ("fnum", "an F-number", f_number, ""),
    ):
        stored = number_at(plain, key, "the file", value)
        if abs(stored - value) > _FIRST_ORDER_TOLERANCE * abs(value):
            notes.append(f"the file states {what} of {stored:.5g}{unit}: it is {value:.5g}{unit}")
    fields, corner_mm = _fields_of_sensor(plain, efl_mm)
    fields_text = (
        f"fields to the sensor's corner ({corner_mm:.4g} mm) by the paraxial focal length"
        if corner_mm
        else "it states no sensor: the axis is the only field"
    )
    notes.append(f"the wavelengths are the lines F, d and C; {fields_text}")
    return replace(lens, field_angles_rad=fields), tuple(notes)


def _surface(block: Table, number: int, places: list[float], order: GlassOrder) -> Surface:
    where = f"surface {number}"
    kind = text_at(block, "type")
    if kind not in _TYPES:
        raise UnsupportedError(f"{where} is of type {kind}; camkit reads {', '.join(_TYPES)}")
    if block.get("is_square") is True and kind in _STOPS:
        raise UnsupportedError(f"{where} is a square stop; camkit has round ones")
    gap_mm = number_at(block, "d_next", where, places[number + 1] - places[number])
    if not math.isfinite(gap_mm):
        raise DecodeError(f"{where} must have d_next, or d and d_sensor; got neither")
    is_flat = kind in (*_STOPS, "Plane")
    terms = without_last_zeros(numbers_at(block, "ai", where) if kind == "Aspheric" else ())
    glass = AIR if kind in _STOPS else _glass(text_at(block, "mat2"), where, order)
    return Surface(
        curvature_per_mm=0.0 if is_flat else _curvature(block, where),
        thickness_mm=gap_mm,
        glass=glass.name,
        material=own_glass(glass, order.user_catalogues),
        semi_diameter_mm=number_at(block, "r", where, math.inf),
        conic=number_at(block, "k", where, 0.0) if kind == "Aspheric" else 0.0,
        even_asphere=terms,
    )


def _curvature(block: Table, where: str) -> float:
    radius_mm = number_at(block, "roc", where, 0.0)
    return 1 / radius_mm if radius_mm else number_at(block, "c", where, 0.0)


def _glass(name: str, where: str, order: GlassOrder) -> Glass:
    """Return the glass of a name in small letters, or of "n_d/V_d"."""
    if name.lower() in _EMPTY:
        return AIR
    try:
        if "/" in name:
            index_d, _, abbe = name.partition("/")
            return model_glass(float(index_d), float(abbe))
        plastic = _PLASTICS.get(name.lower())
        return find_glass(plastic) if plastic else find_zmx_glass(name.upper(), order)
    except ValueError as error:
        raise ContractError(f"{where}: {error}") from error


def _stop(blocks: Sequence[Table]) -> tuple[int, list[str]]:
    stops = [i for i, block in enumerate(blocks) if text_at(block, "type") in _STOPS]
    if len(stops) == 1:
        return stops[0], []
    if stops:
        raise DecodeError(f"one surface must be the stop; got {stops}")
    sizes = [number_at(block, "r", f"surface {i}") for i, block in enumerate(blocks)]
    number = min(range(len(sizes)), key=lambda i: sizes[i])
    return number, [
        f"no surface is a stop: surface {number} is taken, the one of least clear radius "
        f"({sizes[number]:g} mm)"
    ]


def _fields_of_sensor(table: Table, efl_mm: float) -> tuple[tuple[float, ...], float]:
    """Return fields from the axis to the sensor's corner, and its distance from the axis in mm."""
    size = numbers_at(table, "sensor_size", "the file")
    corner_mm = math.hypot(*size) / 2 if len(size) == 2 else 0.0
    for key in ("r_sensor", "r_last"):
        corner_mm = corner_mm or number_at(table, key, "the file", 0.0)
    slope = corner_mm / abs(efl_mm)
    return tuple(sorted({math.atan(share * slope) for share in _FIELD_SHARES})), corner_mm
