"""The best of many random starts within the ranges of a recipe."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.finish import finished
from camkit.models_def.optics.search.least_squares import Residuals, descend
from camkit.models_def.optics.search.limits import Limits
from camkit.models_def.optics.search.problem import Problem, residuals
from camkit.models_def.optics.search.variables import FreeLens, Variable
from camkit.units import UM_PER_MM, to_radians
from tools.start.recipe import LensRecipe


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignResult:
    """A found lens.

    Attributes:
        lens: With semi-diameters that pass every ray of the field.
        merit: Mean residual square (mm): about the mean distance of rays from the centroid.
        merits: Of every kept start, best first.
    """

    lens: Lens
    merit: float
    merits: tuple[float, ...]


def design(recipe: LensRecipe) -> DesignResult:
    """Find a lens: many random starts, a few steps each, the best ones to the end.

    Args:
        recipe: What is free, within which ranges, and the seed.
    """
    problem = problem_of(recipe)
    free = problem.free
    fixed = free.high <= free.low
    rng = np.random.default_rng(recipe.seed)
    starts = torch.from_numpy(rng.uniform(0, 1, (recipe.starts, len(free.variables))))
    merit: Residuals = lambda scaled: residuals(problem, scaled)  # noqa: E731
    scouted = descend(merit, starts, recipe.scout_steps, fixed)
    refined = descend(merit, scouted.scaled[: recipe.kept], recipe.steps, fixed)
    merits = tuple(refined.merits.tolist())
    lens = finished(problem, refined.scaled[0])
    return DesignResult(lens=with_rounded_numbers(lens), merit=merits[0], merits=merits)


def with_rounded_numbers(lens: Lens) -> Lens:
    """Return lens as a drawing would state it: 0.1 um, conics to 4 places, terms to 6 digits."""
    return replace(
        lens,
        surfaces=tuple(
            replace(
                s,
                curvature_per_mm=1 / round(s.radius_mm, 4) if s.curvature_per_mm else 0.0,
                thickness_mm=round(s.thickness_mm, 4),
                conic=round(s.conic, 4),
                even_asphere=tuple(float(f"{a:.6g}") for a in s.even_asphere),
            )
            for s in lens.surfaces
        ),
    )


def problem_of(recipe: LensRecipe) -> Problem:
    """Return the problem that a recipe states: the last curvature is solved, the sensor rides."""
    corner = float(np.tan(to_radians(recipe.half_field_deg)))
    # square-root spacing: every ring of the picture has the same area
    slopes = corner * torch.sqrt(torch.linspace(0, 1, recipe.fields, dtype=torch.float64))
    last = len(recipe.surfaces) - 1
    free = FreeLens(
        lens=_middle(recipe, slopes),
        variables=_variables(recipe),
        solved=last,
        efl_mm=recipe.efl_mm,
    )
    limits = Limits(
        distortion=recipe.distortion_limit,
        min_edge_mm=recipe.min_edge_mm,
        min_bfl_mm=recipe.min_bfl_mm,
    )
    return Problem(
        free=free,
        slopes=slopes,
        wavelengths_um=torch.tensor(recipe.wavelengths_um, dtype=torch.float64),
        samples=half_disc(recipe.pupil_rays),
        core_mm=recipe.blur_floor_um / UM_PER_MM,
        limits=limits,
        merit_fields=recipe.merit_fields,
    )


def _variables(recipe: LensRecipe) -> tuple[Variable, ...]:
    inner = range(len(recipe.surfaces) - 1)
    surfaces = recipe.surfaces
    free = [("curvature", i, 0, surfaces[i].curvature_range_per_mm) for i in inner]
    free += [("thickness", i, 0, surfaces[i].thickness_range_mm) for i in inner]
    free.append(("defocus", 0, 0, recipe.focus_range_mm))
    free += [("conic", i, 0, s.conic_range) for i, s in enumerate(surfaces)]
    free += [
        ("even_asphere", i, term, bounds)
        for i, s in enumerate(surfaces)
        for term, bounds in enumerate(s.even_asphere_ranges)
    ]
    return tuple(
        Variable(kind=kind, surface=i, term=term, low=bounds[0], high=bounds[1])  # type: ignore[arg-type]
        for kind, i, term, bounds in free
    )


def _middle(recipe: LensRecipe, slopes: Tensor) -> Lens:
    """Return a lens in the middle of the ranges; what is searched for does not depend on it."""
    surfaces = tuple(
        Surface(
            curvature_per_mm=sum(s.curvature_range_per_mm) / 2,
            thickness_mm=sum(s.thickness_range_mm) / 2,
            glass=s.glass,
        )
        for s in recipe.surfaces
    )
    return Lens(
        name=recipe.name,
        note=f"found by tools.design_start from the recipe of {recipe.name}",
        surfaces=surfaces,
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=recipe.efl_mm / recipe.f_number / 2,
        object_distance_mm=recipe.object_distance_mm,
        field_angles_rad=tuple(torch.atan(slopes).tolist()),
        wavelengths_um=recipe.wavelengths_um,
        reference_wavelength_um=recipe.reference_wavelength_um,
    )
