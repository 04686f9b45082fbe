"""Lens design by damped least squares on spots, from the best of many random starts.

The lenses of a search are traced together: one leading dimension holds starts times difference
columns. The last curvature is solved for the focal length, the sensor rides on the paraxial
focus. Residuals are (x, y) (r^2 + s^2)^(-1/4) about the centroid of all wavelengths, so that the
sum of squares is a sum of |r|: halos cost less than in an RMS merit, cores more, which is what
deconvolution wants.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.models_def.optics.glass import find_glass, refractive_index
from camkit.models_def.optics.paraxial import trace_paraxial
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.pupil import PupilSamples, half_disc, launch
from camkit.models_def.optics.recipe import LensRecipe
from camkit.models_def.optics.trace import Rays, SurfaceTensors, sag, trace
from camkit.units import UM_PER_MM, to_radians

_DIFFERENCE: Final = 1e-6
_LOST_RAY: Final = 1.0
_PENALTY_PER_MM: Final = 3.0
_DAMPING_RANGE: Final = (1e-6, 1e6)
_CLEARANCE_MM: Final = 0.5


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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Problem:
    """The recipe as tensors: bounds (variable,), index (surface + 1, wavelength, 1)."""

    recipe: LensRecipe
    low: Tensor
    high: Tensor
    index: Tensor
    reference_index: Tensor
    slopes: Tensor
    samples: PupilSamples

    @property
    def surfaces(self) -> int:
        """How many surfaces the lens has."""
        return len(self.recipe.surfaces)


def _problem(recipe: LensRecipe) -> _Problem:
    surfaces = recipe.surfaces
    ranges = [s.curvature_range_per_mm for s in surfaces[:-1]]
    ranges += [s.thickness_range_mm for s in surfaces[:-1]]
    ranges.append(recipe.focus_range_mm)
    ranges += [s.conic_range for s in surfaces]
    bounds = torch.tensor(ranges, dtype=torch.float64)
    waves = torch.tensor(
        [*recipe.wavelengths_um, recipe.reference_wavelength_um], dtype=torch.float64
    )
    media = [torch.ones_like(waves)]
    media += [refractive_index(find_glass(s.glass), waves) for s in surfaces]
    index = torch.stack(media)
    corner = float(np.tan(to_radians(recipe.half_field_deg)))
    # square-root spacing: every ring of the picture has the same area
    share = torch.sqrt(torch.linspace(0, 1, recipe.fields, dtype=torch.float64))
    return _Problem(
        recipe=recipe,
        low=bounds[:, 0],
        high=bounds[:, 1],
        index=index[:, :-1, None],
        reference_index=index[:, -1],
        slopes=share * corner,
        samples=half_disc(recipe.pupil_rays),
    )


def _tensors(problem: _Problem, variables: Tensor) -> SurfaceTensors:
    """Give lenses (surface, start, 1, 1, 1) for scaled variables (start, variable) in 0..1."""
    values = problem.low + variables * (problem.high - problem.low)
    count = problem.surfaces
    free, gaps = values[:, : count - 1].T, values[:, count - 1 : 2 * count - 2].T
    defocus, conic = values[:, 2 * count - 2], values[:, 2 * count - 1 :].T
    zero = torch.zeros_like(free[:1])
    front = SurfaceTensors(
        curvature_per_mm=torch.cat([free, zero]),
        conic=conic,
        even_asphere=torch.zeros(count, 0, 1, dtype=torch.float64),
        thickness_mm=torch.cat([gaps, zero]),
        semi_diameter_mm=torch.full((count, 1), torch.inf, dtype=torch.float64),
        index=problem.reference_index[:, None],
        aspheric=(False,) * count,
    )
    one = torch.ones_like(zero[0])
    height, slope = trace_paraxial(front, one, torch.zeros_like(one), range(count - 1))
    height = height + gaps[-1] * slope
    before, after = problem.reference_index[-2], problem.reference_index[-1]
    wanted = -1 / problem.recipe.efl_mm
    last = (before * slope - after * wanted) / (height * (after - before))
    focus = -height / wanted + defocus

    def shaped(value: Tensor) -> Tensor:
        return value[..., None, None, None]

    return replace(
        front,
        curvature_per_mm=shaped(torch.cat([free, last[None]])),
        conic=shaped(front.conic),
        thickness_mm=shaped(torch.cat([gaps, focus[None]])),
        semi_diameter_mm=shaped(front.semi_diameter_mm),
        even_asphere=torch.zeros(count, 0, 1, 1, 1, 1, dtype=torch.float64),
        index=problem.index,
    )


def _residuals(problem: _Problem, variables: Tensor) -> Tensor:
    """Give residuals (start, residual) for scaled variables (start, variable)."""
    recipe, tensors = problem.recipe, _tensors(problem, variables)
    stop_mm = recipe.efl_mm / recipe.f_number / 2
    starts = variables.shape[0]
    # ray 0 is the chief ray
    x = torch.cat([torch.zeros(1, dtype=torch.float64), problem.samples.x * stop_mm])
    y = torch.cat([torch.zeros(1, dtype=torch.float64), problem.samples.y * stop_mm])
    slope = problem.slopes[:, None, None]
    shape = (starts, len(problem.slopes), problem.index.shape[1], len(x))
    rays = launch(x.expand(shape), y.expand(shape), slope, torch.inf)
    seen: list[Rays] = []
    landed = trace(tensors, rays, seen=seen)
    spots = _spot_residuals(landed, recipe.blur_floor_um / UM_PER_MM)
    limits = _limit_residuals(problem, tensors, landed, seen)
    return torch.cat([spots, limits], dim=1)


def _spot_residuals(landed: Rays, floor_mm: float) -> Tensor:
    alive = landed.valid[..., 1:].to(torch.float64)
    x, y = landed.x[..., 1:], landed.y[..., 1:]
    count = alive.sum((-2, -1), keepdim=True).clamp_min(1)
    dy = y - (y * alive).sum((-2, -1), keepdim=True) / count
    scale = (x**2 + dy**2 + floor_mm**2) ** -0.25 * alive
    lost = (1 - alive) * _LOST_RAY
    pairs = torch.stack([x * scale + lost, dy * scale], dim=-1)
    each = pairs[0].numel() // 2
    residuals: Tensor = pairs.flatten(1) / each**0.5
    return residuals


def _limit_residuals(
    problem: _Problem, tensors: SurfaceTensors, landed: Rays, seen: list[Rays]
) -> Tensor:
    recipe = problem.recipe
    chief = landed.y[:, 1:, landed.y.shape[2] // 2, 0]
    ideal = recipe.efl_mm * problem.slopes[1:]
    bent = torch.relu(torch.abs(chief / ideal - 1) - recipe.distortion_limit)
    reach = torch.stack([torch.hypot(r.x, r.y).flatten(1).amax(1) for r in seen])
    wide = torch.maximum(reach[1:-1], reach[2:])
    curvature = tensors.curvature_per_mm[..., 0, 0, 0]
    conic, none = tensors.conic[..., 0, 0, 0], torch.zeros(0, 1, dtype=torch.float64)
    # the edge: sag difference of two neighbouring surfaces at the larger of their heights
    front = sag(curvature[1:-1], conic[1:-1], none, wide**2)
    back = sag(curvature[2:], conic[2:], none, wide**2)
    gaps = tensors.thickness_mm[1:-1, :, 0, 0, 0]
    least = torch.tensor(
        [recipe.min_edge_mm if s.glass != "air" else 0.1 for s in recipe.surfaces[1:-1]],
        dtype=torch.float64,
    )[:, None]
    thin = torch.relu(least - (gaps + back - front))
    steep = torch.relu(torch.abs(curvature[1:-1] * wide) - 0.8)
    short = torch.relu(recipe.min_bfl_mm - tensors.thickness_mm[-1, :, 0, 0, 0])[None]
    solved = torch.relu(torch.abs(curvature[-1:]) - 0.08) * 10
    rows = [bent * 10, thin.T, steep.T, short.T, solved.T]
    return torch.cat(rows, dim=1) * _PENALTY_PER_MM


def _jacobian(problem: _Problem, variables: Tensor) -> tuple[Tensor, Tensor]:
    """Give residuals (start, residual) and derivatives (start, residual, variable)."""
    starts, count = variables.shape
    steps = torch.eye(count, dtype=torch.float64) * _DIFFERENCE
    both = torch.cat([variables[:, None], variables[:, None] + steps], dim=1)
    values = _residuals(problem, both.flatten(0, 1)).reshape(starts, count + 1, -1)
    return values[:, 0], ((values[:, 1:] - values[:, :1]) / _DIFFERENCE).transpose(1, 2)


def _descend(problem: _Problem, variables: Tensor, steps: int) -> tuple[Tensor, Tensor]:
    """Run damped least squares (Levenberg-Marquardt) on all starts; give variables and merits."""
    damping = torch.full((len(variables), 1), 1e-2, dtype=torch.float64)
    for _ in range(steps):
        value, slope = _jacobian(problem, variables)
        merit = (value**2).sum(1)
        normal = slope.transpose(1, 2) @ slope
        gradient = (slope.transpose(1, 2) @ value[..., None])[..., 0]
        # variables at a bound that would leave it, and fixed ones, stay
        held = ((variables <= 0) & (gradient > 0)) | ((variables >= 1) & (gradient < 0))
        held = held | (problem.high <= problem.low)
        diagonal = normal.diagonal(dim1=1, dim2=2)
        weight = torch.where(held, 1e12, damping * diagonal + 1e-9)
        change = torch.linalg.solve(normal + torch.diag_embed(weight), -gradient)
        moved = torch.where(held, variables, (variables + change).clamp(0, 1))
        better = (_residuals(problem, moved) ** 2).sum(1) < merit
        variables = torch.where(better[:, None], moved, variables)
        factor = torch.where(better, 0.3, 4.0)[:, None]
        damping = (damping * factor).clamp(*_DAMPING_RANGE)
    return variables, (_residuals(problem, variables) ** 2).sum(1)


def design(recipe: LensRecipe) -> DesignResult:
    """Find a lens: many random starts, a few steps each, the best ones to the end.

    Args:
        recipe: What is free, within which ranges, and the seed.
    """
    problem = _problem(recipe)
    rng = np.random.default_rng(recipe.seed)
    drawn = torch.from_numpy(rng.uniform(0, 1, (recipe.starts, len(problem.low))))
    with torch.no_grad():
        scouted, merits = _descend(problem, drawn, recipe.scout_steps)
        order = torch.argsort(merits)[: recipe.kept]
        found, merits = _descend(problem, scouted[order], recipe.steps)
        order = torch.argsort(merits)
        best = found[order[0]][None]
        lens = _lens(problem, best)
    ordered = tuple(float(m) for m in merits[order])
    return DesignResult(lens=lens, merit=ordered[0], merits=ordered)


def _lens(problem: _Problem, variables: Tensor) -> Lens:
    recipe = problem.recipe
    tensors = _tensors(problem, variables)
    stop_mm = recipe.efl_mm / recipe.f_number / 2
    rim = torch.linspace(-stop_mm, stop_mm, 41, dtype=torch.float64)
    rays = launch(torch.zeros_like(rim), rim, problem.slopes[:, None, None], torch.inf)
    seen: list[Rays] = []
    trace(tensors, rays, seen=seen)
    surfaces = []
    for i, surface in enumerate(recipe.surfaces):
        reach = float(torch.hypot(seen[i].x, seen[i].y).max())
        # the stop limits the beam by its own size; the others must pass it all
        semi_mm = stop_mm if i == 0 else round(reach + _CLEARANCE_MM, 1)
        surfaces.append(
            Surface(
                curvature_per_mm=_rounded_curvature(float(tensors.curvature_per_mm[i])),
                thickness_mm=round(float(tensors.thickness_mm[i]), 4),
                glass=surface.glass,
                semi_diameter_mm=semi_mm,
                conic=round(float(tensors.conic[i]), 4),
            )
        )
    return Lens(
        name=recipe.name,
        note=f"found by camkit.models_def.optics.optimize from the recipe of {recipe.name}",
        surfaces=tuple(surfaces),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=stop_mm,
        field_angles_rad=tuple(float(a) for a in torch.atan(problem.slopes)),
        wavelengths_um=recipe.wavelengths_um,
        reference_wavelength_um=recipe.reference_wavelength_um,
    )


def _rounded_curvature(curvature: float) -> float:
    """Give 1 / radius for the radius rounded to 0.1 um, as a drawing would state it."""
    return 1 / round(1 / curvature, 4) if curvature else 0.0
