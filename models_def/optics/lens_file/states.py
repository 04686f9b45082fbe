"""A lens with configurations, and the lens in one of them."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import cast

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.configuration.configuration import (
    BY_SURFACE,
    Configuration,
    Sizes,
    find_configuration,
)
from camkit.models_def.optics.prescription import ApertureKind, Lens, Surface


def plain_lens(lens: Lens, choice: str | int | None = None) -> Lens:
    """Return the lens in one state, which its name says; a lens without any as it is.

    Args:
        lens: With or without configurations.
        choice: Name of a state, or its number from 1; None for the usual one.

    Raises:
        ContractError: If there is no such state, or the lens in it makes no sense.
    """
    if not lens.configurations:
        if choice is not None:
            raise ContractError(
                f"{lens.name} has no configurations; leave {option_text('configuration')} out"
            )
        return lens
    state = find_configuration(lens.configurations, lens.default_configuration, choice)
    try:
        return named_state(_changed(lens, state), state.name)
    except ContractError as error:
        raise ContractError(f"configuration {state.name}: {error}") from error


def named_state(lens: Lens, state: str) -> Lens:
    """Return a lens that says the state that it is in, in its name too."""
    return replace(lens, name=f"{lens.name} (configuration {state})", state=state)


def configuration_name(lens: Lens, choice: str | int | None = None) -> str:
    """Return the name of the state that `plain_lens` gives; empty for a lens without any."""
    if not lens.configurations:
        return ""
    return find_configuration(lens.configurations, lens.default_configuration, choice).name


def _changed(lens: Lens, state: Configuration) -> Lens:
    surfaces = list(lens.surfaces)
    for surface, gap_mm in state.thickness_mm:
        surfaces[surface] = replace(surfaces[surface], thickness_mm=gap_mm)
    for surface, rim_mm in state.semi_diameter_mm:
        surfaces[surface] = replace(surfaces[surface], semi_diameter_mm=rim_mm)
    distance_mm, fields = state.object_distance_mm, state.field_angles_rad
    kind, value = lens.aperture_kind, lens.aperture_value
    if state.aperture_kind:
        kind, value = cast("ApertureKind", state.aperture_kind), state.aperture_value
    return replace(
        lens,
        surfaces=tuple(surfaces),
        object_distance_mm=lens.object_distance_mm if distance_mm is None else distance_mm,
        aperture_kind=kind,
        aperture_value=value,
        field_angles_rad=lens.field_angles_rad if fields is None else fields,
        configurations=(),
        default_configuration="",
    )


def with_states(lens: Lens, states: Mapping[str, Lens], usual: str = "") -> Lens:
    """Return a lens with the states in which it was read one by one.

    Each state names what differs between any two.

    Args:
        lens: As its surfaces state it.
        states: By name; they have its surfaces but for gaps and rims.
        usual: Name of the state that is taken where none is named; empty for the first.
    """
    lenses = (lens, *states.values())

    def differs(part: Callable[[Lens], object]) -> bool:
        return any(part(one) != part(lens) for one in lenses)

    def moving(key: str) -> list[int]:
        return [
            i
            for i in range(len(lens.surfaces))
            if any(_size(one.surfaces[i], key) != _size(lens.surfaces[i], key) for one in lenses)
        ]

    movable = {key: moving(key) for key in BY_SURFACE}
    has_distance = differs(lambda one: one.object_distance_mm)
    has_aperture = differs(lambda one: (one.aperture_kind, one.aperture_value))
    has_fields = differs(lambda one: one.field_angles_rad)

    def sizes(one: Lens, key: str) -> Sizes:
        return tuple((i, _size(one.surfaces[i], key)) for i in movable[key])

    return replace(
        lens,
        configurations=tuple(
            Configuration(
                name=name,
                thickness_mm=sizes(one, "thickness_mm"),
                semi_diameter_mm=sizes(one, "semi_diameter_mm"),
                object_distance_mm=one.object_distance_mm if has_distance else None,
                aperture_kind=one.aperture_kind if has_aperture else "",
                aperture_value=one.aperture_value if has_aperture else 0.0,
                field_angles_rad=one.field_angles_rad if has_fields else None,
            )
            for name, one in states.items()
        ),
        default_configuration=usual,
    )


def _size(surface: Surface, key: str) -> float:
    size: float = getattr(surface, key)
    return size
