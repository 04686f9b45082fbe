"""The table [[configuration]] of a prescription."""

from dataclasses import dataclass, field
from typing import Any, Final

from camkit.errors import ContractError
from camkit.models_def.optics.configuration.configuration import (
    BY_SURFACE,
    Configuration,
    Sizes,
)
from camkit.models_def.optics.configuration.exact_text import degrees_text
from camkit.models_def.toml_table import key_line, section, typed
from camkit.units import to_radians

APERTURES: Final = ("f_number", "entrance_pupil_diameter_mm", "stop_semi_diameter_mm")


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfigurationTable:
    """One state of a lens; what it does not name stays. At most one of the apertures is given.

    Attributes:
        name: Name that `--configuration` takes.
        thickness_mm: Gaps by the number of the surface before them, from 0, such as
            `{ 4 = 1.8, 19 = 7.9 }`.
        semi_diameter_mm: Rims by the number of their surface, such as a stop that opens.
        object_distance_mm: Distance of the object from the first vertex; inf is far away.
        f_number: Aperture as an F-number.
        entrance_pupil_diameter_mm: Aperture as the diameter of the entrance pupil.
        stop_semi_diameter_mm: Aperture as the radius of the stop.
        field_angles_deg: Fields, increasing.
    """

    name: str
    thickness_mm: dict[str, Any] = field(default_factory=dict)
    semi_diameter_mm: dict[str, Any] = field(default_factory=dict)
    object_distance_mm: float | None = None
    f_number: float | None = None
    entrance_pupil_diameter_mm: float | None = None
    stop_semi_diameter_mm: float | None = None
    field_angles_deg: tuple[float, ...] | None = None


def parse_configuration(where: str, table: Any) -> Configuration:
    """Read a state from its table.

    Raises:
        ContractError: If a key is unknown, missing or of a wrong type.
    """
    keys = section(where, ConfigurationTable, table)
    apertures = {kind: getattr(keys, kind) for kind in APERTURES}
    kinds = [kind for kind, value in apertures.items() if value is not None]
    if len(kinds) > 1:
        raise ContractError(f"{where}: give at most one of {', '.join(APERTURES)}; got {kinds}")
    angles = keys.field_angles_deg
    thickness_mm, semi_diameter_mm = (_sizes(where, key, getattr(keys, key)) for key in BY_SURFACE)
    return Configuration(
        name=keys.name,
        thickness_mm=thickness_mm,
        semi_diameter_mm=semi_diameter_mm,
        object_distance_mm=keys.object_distance_mm,
        aperture_kind="".join(kinds),
        aperture_value=apertures[kinds[0]] if kinds else 0.0,
        field_angles_rad=None if angles is None else tuple(map(to_radians, angles)),
    )


def _sizes(where: str, key: str, table: dict[str, Any]) -> Sizes:
    astray = [number for number in table if not number.isdecimal()]
    if astray:
        raise ContractError(
            f"{where}.{key}: keys are numbers of surfaces, as in {{ 4 = 1.8 }}; got {astray}"
        )
    return tuple((int(i), typed(f"{where}.{key}.{i}", mm, float)) for i, mm in table.items())


def configuration_lines(state: Configuration) -> list[str]:
    """Return the lines of a state; `parse_configuration` gives it back to the last bit."""
    lines = [key_line("name", state.name)]
    for key in BY_SURFACE:
        sizes = ", ".join(f"{surface} = {mm!r}" for surface, mm in getattr(state, key))
        lines += [f"{key} = {{ {sizes} }}"] if sizes else []
    if state.object_distance_mm is not None:
        lines.append(f"object_distance_mm = {state.object_distance_mm!r}")
    if state.aperture_kind:
        lines.append(f"{state.aperture_kind} = {state.aperture_value!r}")
    if state.field_angles_rad is not None:
        angles = ", ".join(map(degrees_text, state.field_angles_rad))
        lines.append(f"field_angles_deg = [{angles}]")
    return lines
