"""The recipe of a lens search: what is free, within which ranges, from which seed (TOML)."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from camkit.errors import ContractError
from camkit.models_def.optics.glass import find_glass

Range = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceRecipe:
    """One surface: its glass (after it), ranges of curvature, thickness and conic (0: sphere)."""

    glass: str
    curvature_range_per_mm: Range
    thickness_range_mm: Range
    conic_range: Range = (0.0, 0.0)

    def __post_init__(self) -> None:
        find_glass(self.glass)


@dataclass(frozen=True, slots=True, kw_only=True)
class LensRecipe:
    """A lens search; surface 0 is a plane stop in front of the lens.

    Attributes:
        name: Of the lens.
        efl_mm: Focal length, kept exactly by the last curvature.
        f_number: EFL over the stop diameter.
        half_field_deg: Field angle of the corner.
        fields: How many fields from the axis to the corner, rings of equal area.
        pupil_rays: In half the pupil.
        wavelengths_um: Increasing, an odd number; the middle one judges distortion.
        reference_wavelength_um: Of focal length and focus.
        distortion_limit: Share of the ideal height that costs nothing.
        min_edge_mm: Least edge thickness of an element.
        min_bfl_mm: Least distance to the sensor.
        blur_floor_um: s of the residual.
        seed: Of the random starts.
        starts: How many.
        scout_steps: Steps of each start.
        kept: How many go on.
        steps: Steps of those.
        focus_range_mm: Of the sensor about the paraxial focus.
        surfaces: In the order of the light.
    """

    name: str
    efl_mm: float
    f_number: float
    half_field_deg: float
    fields: int
    pupil_rays: int
    wavelengths_um: tuple[float, ...]
    reference_wavelength_um: float
    distortion_limit: float
    min_edge_mm: float
    min_bfl_mm: float
    blur_floor_um: float
    seed: int
    starts: int
    scout_steps: int
    kept: int
    steps: int
    focus_range_mm: Range
    surfaces: tuple[SurfaceRecipe, ...]

    def __post_init__(self) -> None:
        if len(self.surfaces) < 3 or self.surfaces[0].curvature_range_per_mm != (0.0, 0.0):
            raise ContractError("surface 0 of a lens recipe must be the stop, a plane")
        if not 1 <= self.kept <= self.starts:
            raise ContractError(f"kept must be 1..starts; got {self.kept} of {self.starts}")


def read_recipe(path: Path) -> LensRecipe:
    """Read a lens recipe.

    Raises:
        ContractError: If it is not TOML or a key is unknown or missing.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ContractError(f"a lens recipe must be TOML; {error}") from error
    surfaces = tuple(_surface(t) for t in table.pop("surface", []))
    _check(table, {f.name for f in fields(LensRecipe)} - {"surfaces"}, "the recipe")
    values: dict[str, Any] = {key: _value(key, value) for key, value in table.items()}
    return LensRecipe(surfaces=surfaces, **values)


def _value(key: str, value: Any) -> Any:
    """Give a value in the type of its field; lists of numbers become tuples."""
    wanted = LensRecipe.__annotations__[key]
    if wanted in (str, int):
        if not isinstance(value, wanted) or isinstance(value, bool):
            raise ContractError(f"{key} must be {wanted.__name__}; got {value!r}")
        return value
    numbers = value if isinstance(value, list) else [value]
    if any(isinstance(v, bool) or not isinstance(v, int | float) for v in numbers):
        raise ContractError(f"{key} must be numbers; got {value!r}")
    if wanted is float:
        if isinstance(value, list):
            raise ContractError(f"{key} must be one number; got {value!r}")
        return float(value)
    return tuple(float(v) for v in numbers)


def _surface(table: Mapping[str, Any]) -> SurfaceRecipe:
    table = {"conic_range": [0.0, 0.0], **table}
    _check(table, {f.name for f in fields(SurfaceRecipe)}, "a surface of the recipe")
    return SurfaceRecipe(
        glass=str(table["glass"]),
        curvature_range_per_mm=_range(table["curvature_range_per_mm"]),
        thickness_range_mm=_range(table["thickness_range_mm"]),
        conic_range=_range(table["conic_range"]),
    )


def _range(value: Any) -> Range:
    if not isinstance(value, list) or len(value) != 2 or value[0] > value[1]:
        raise ContractError(f"a range is [low, high]; got {value!r}")
    return float(value[0]), float(value[1])


def _check(table: Mapping[str, Any], known: set[str], where: str) -> None:
    if set(table) != known:
        raise ContractError(
            f"{where}: unknown keys {sorted(set(table) - known)}, "
            f"missing keys {sorted(known - set(table))}"
        )
