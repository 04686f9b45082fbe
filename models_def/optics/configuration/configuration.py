"""One state of a lens with moving parts: a focus position or a zoom state."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from camkit.bundle.states.lens_state import find_name
from camkit.errors import ContractError

BY_SURFACE: Final = ("thickness_mm", "semi_diameter_mm")
"""Keys of a state that name surfaces one by one."""

Sizes = tuple[tuple[int, float], ...]
"""(surface, mm), one entry for each surface that a state names, in their order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Configuration:
    """Changes of a lens in one state; all that it does not name stays.

    Attributes:
        name: By which people choose it.
        thickness_mm: Gaps after surfaces.
        semi_diameter_mm: Rims of surfaces, such as a stop that opens as the lens zooms.
        object_distance_mm: From the first vertex; None where it stays.
        aperture_kind: What `aperture_value` is; empty where the aperture stays.
        aperture_value: F-number or a length in mm.
        field_angles_rad: Fields of interest, increasing; None where they stay.
    """

    name: str
    thickness_mm: Sizes = ()
    semi_diameter_mm: Sizes = ()
    object_distance_mm: float | None = None
    aperture_kind: str = ""
    aperture_value: float = 0.0
    field_angles_rad: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise ContractError("a configuration needs a name; got an empty one")
        for key in BY_SURFACE:
            sizes = dict(getattr(self, key))
            if not all(map(math.isfinite, sizes.values())) and key == "thickness_mm":
                raise ContractError(f"configuration {self.name}: gaps must be finite; got {sizes}")
            object.__setattr__(self, key, tuple(sorted(sizes.items())))

    @property
    def surfaces(self) -> set[int]:
        """The surfaces that it names."""
        return {surface for surface, _ in (*self.thickness_mm, *self.semi_diameter_mm)}

    def scaled(self, factor: float) -> "Configuration":
        """Return the state of a lens whose every length is times a factor."""
        distance_mm = self.object_distance_mm
        return replace(
            self,
            thickness_mm=_times(self.thickness_mm, factor),
            semi_diameter_mm=_times(self.semi_diameter_mm, factor),
            object_distance_mm=None if distance_mm is None else distance_mm * factor,
            aperture_value=self.aperture_value
            * (1 if self.aperture_kind == "f_number" else factor),
        )

    def shifted(self, surface: int, shift_mm: float) -> "Configuration":
        """Return the state with one gap, if it names that gap, larger by `shift_mm`."""
        sizes = tuple((i, mm + shift_mm * (i == surface)) for i, mm in self.thickness_mm)
        return replace(self, thickness_mm=sizes)


def _times(sizes: Sizes, factor: float) -> Sizes:
    return tuple((surface, mm * factor) for surface, mm in sizes)


def check_configurations(states: Sequence[Configuration], surface_count: int, usual: str) -> None:
    """Refuse states of one name, of surfaces that are not there, and an unknown usual one.

    Args:
        states: Of one lens.
        surface_count: Of the lens.
        usual: Name of the state that is taken where none is named; empty for the first.

    Raises:
        ContractError: If one is wrong.
    """
    names = [state.name for state in states]
    if len(set(names)) < len(names):
        raise ContractError(f"configurations need names of their own; got {', '.join(names)}")
    for state in states:
        astray = sorted(i for i in state.surfaces if not 0 <= i < surface_count)
        if astray:
            raise ContractError(
                f"configuration {state.name}: surfaces are 0..{surface_count - 1}; got {astray}"
            )
    if usual and usual not in names:
        raise ContractError(
            f"default_configuration must be one of {', '.join(names) or 'none'}; got {usual!r}"
        )


def find_configuration(
    states: Sequence[Configuration], usual: str, choice: str | int | None
) -> Configuration:
    """Return one of several states.

    Args:
        states: Of one lens, at least one.
        usual: Name of the state that is taken where none is named; empty for the first.
        choice: See `find_name`.

    Raises:
        ContractError: If there is no such state; the message names all.
    """
    by_name = {state.name: state for state in states}
    return by_name[find_name(list(by_name), usual, choice)]
