"""Tolerances from TOML: the table [tolerance] of a lens file, or of a file of its own."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from camkit.errors import ContractError
from camkit.models_def.optics.tolerance.errors import (
    ERROR_CLASSES,
    ErrorClass,
    ErrorWidth,
    Tolerances,
)
from camkit.side_file import read_side_toml
from camkit.units import to_radians

TABLE: Final = "tolerance"
_ARCMIN: Final = to_radians(1 / 60)
# key of a file: class, and the class's unit in that of the key
KEYS: Final[dict[str, tuple[ErrorClass, float]]] = {
    "radius_percent": ("radius", 0.01),
    "thickness_mm": ("thickness", 1.0),
    "index": ("index", 1.0),
    "abbe_percent": ("abbe", 0.01),
    "conic": ("conic", 1.0),
    "power_fringes": ("power", 1.0),
    "irregularity_fringes": ("irregularity", 1.0),
    "groove_depth_percent": ("groove_depth", 0.01),
    "surface_decentre_mm": ("surface_decentre", 1.0),
    "surface_tilt_arcmin": ("surface_tilt", _ARCMIN),
    "surface_tilt_deg": ("surface_tilt", to_radians(1.0)),
    "element_decentre_mm": ("element_decentre", 1.0),
    "element_tilt_arcmin": ("element_tilt", _ARCMIN),
    "element_tilt_deg": ("element_tilt", to_radians(1.0)),
    "wedge_arcmin": ("wedge", _ARCMIN),
    "wedge_deg": ("wedge", to_radians(1.0)),
    "focus_mm": ("focus", 1.0),
}
_UNIT_TEXTS: Final = {"percent": " %", "mm": " mm", "arcmin": "'", "fringes": " fringes"}
_SETTINGS: Final = {"distribution", "compensator", "compensator_gap"}
_ENTRY_KEYS: Final = {"half_width", "distribution"}


def read_tolerances(path: Path) -> Tolerances | None:
    """Read the [tolerance] table of a TOML file; None if it has none.

    Raises:
        ContractError: If the file is not TOML, or the table is wrong.
    """
    table = read_side_toml(path, "the lens")
    return parse_tolerances(table[TABLE]) if TABLE in table else None


def parse_tolerances(table: object) -> Tolerances:
    """Return the tolerances of a [tolerance] table; classes that it does not name are 0.

    A class is a half-width, or `{ half_width = 0.1, distribution = "normal" }`.

    Raises:
        ContractError: If a key is unknown, names a class twice, or has a wrong value.
    """
    if not isinstance(table, Mapping):
        raise ContractError(f"[{TABLE}] must be a table; got {table!r:.80}")
    unknown = sorted(set(table) - set(KEYS) - _SETTINGS)
    if unknown:
        keys = ", ".join((*KEYS, *sorted(_SETTINGS)))
        raise ContractError(f"[{TABLE}]: unknown keys {unknown}; known are {keys}")
    common = table.get("distribution", "uniform")
    widths: dict[str, Any] = dict.fromkeys(ERROR_CLASSES, ErrorWidth(half_width=0.0))
    classes: set[str] = set()
    for key in (key for key in table if key in KEYS):
        error_class, unit = KEYS[key]
        if error_class in classes:
            raise ContractError(f"[{TABLE}]: {key} names {error_class} again; keep one of the two")
        classes.add(error_class)
        widths[error_class] = _width(key, table[key], unit, common)
    gap = table.get("compensator_gap")
    if gap is not None and (isinstance(gap, bool) or not isinstance(gap, int)):
        raise ContractError(
            f"[{TABLE}]: compensator_gap must be the number of a surface; got {gap!r:.80}"
        )
    return Tolerances(
        **widths, compensator=table.get("compensator", "paraxial"), compensator_gap=gap
    )


def _width(key: str, value: object, unit: float, common: Any) -> ErrorWidth:
    entry: Mapping[str, Any] = value if isinstance(value, Mapping) else {"half_width": value}
    number = entry.get("half_width")
    wrong = sorted(set(entry) - _ENTRY_KEYS)
    if wrong or isinstance(number, bool) or not isinstance(number, int | float):
        raise ContractError(
            f"[{TABLE}]: {key} must be a number or {{ half_width = NUMBER, distribution = NAME }}; "
            f"got {value!r:.80}"
        )
    if not 0 <= number < math.inf:
        raise ContractError(f"[{TABLE}]: {key} must be finite and >= 0; got {number!r}")
    return ErrorWidth(half_width=number * unit, distribution=entry.get("distribution", common))


def in_file_units(error_class: ErrorClass, value: float) -> str:
    """Return an error as people write it, such as `0.2 %`."""
    key, unit = next(
        (key, unit) for key, (file_class, unit) in KEYS.items() if file_class == error_class
    )
    number = f"{value / unit:.4g}"
    text = _UNIT_TEXTS.get(key.rpartition("_")[2], "")
    return number + (text.removesuffix("s") if number in {"1", "-1"} else text)
