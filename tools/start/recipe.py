"""The recipe of a lens search: what is free, within which ranges, from which seed (TOML)."""

import math
from dataclasses import dataclass
from pathlib import Path

from camkit.errors import ContractError
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.toml_table import section
from camkit.side_file import read_side_toml

Range = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceRecipe:
    """One surface.

    Attributes:
        glass: After it.
        curvature_range_per_mm: See there.
        thickness_range_mm: After it.
        conic_range: [0, 0] is a sphere.
        even_asphere_ranges: Of the coefficients of r^2, r^4, ...
    """

    glass: str
    curvature_range_per_mm: Range
    thickness_range_mm: Range
    conic_range: Range = (0.0, 0.0)
    even_asphere_ranges: tuple[Range, ...] = ()

    def __post_init__(self) -> None:
        find_glass(self.glass)
        ranges = (self.curvature_range_per_mm, self.thickness_range_mm, self.conic_range)
        for bounds in (*ranges, *self.even_asphere_ranges):
            _check_range(bounds)


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
        object_distance_mm: The sensor is focused on it, with `focus_range_mm`.
        merit_fields: How many of the fields, from the axis, should be sharp; 0 for all. The others
            only must pass their rays.
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
    object_distance_mm: float = math.inf
    merit_fields: int = 0

    def __post_init__(self) -> None:
        if len(self.surfaces) < 3 or self.surfaces[0].curvature_range_per_mm != (0.0, 0.0):
            raise ContractError("surface 0 of a lens recipe must be the stop, a plane")
        _check_range(self.focus_range_mm)
        if not 1 <= self.kept <= self.starts:
            raise ContractError(f"kept must be 1..starts; got {self.kept} of {self.starts}")
        if not 0 <= self.merit_fields <= self.fields:
            raise ContractError(f"merit_fields must be 0..fields; got {self.merit_fields}")
        if not self.object_distance_mm > 0:
            raise ContractError(f"object_distance_mm must be > 0; got {self.object_distance_mm}")


def read_recipe(path: Path) -> LensRecipe:
    """Read a lens recipe.

    Raises:
        ContractError: If it is not TOML or a key is unknown, missing or of a wrong type.
    """
    table = read_side_toml(path, "lens recipe")
    surfaces = table.pop("surface", [])
    if not isinstance(surfaces, list):
        raise ContractError("surfaces of a lens recipe must be written as [[surface]] tables")
    surface_recipes = [section(f"surface[{i}]", SurfaceRecipe, t) for i, t in enumerate(surfaces)]
    # the tables are surfaces already: they pass the type check of their field as they are
    return section("lens recipe", LensRecipe, {**table, "surfaces": surface_recipes})


def _check_range(bounds: Range) -> None:
    if len(bounds) != 2 or bounds[0] > bounds[1]:
        raise ContractError(f"a range is [low, high]; got {list(bounds)}")
