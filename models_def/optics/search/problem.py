"""A lens problem: what is free, what is looked at, what is good; one residual function."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import torch
from torch import Tensor

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.asymmetric.turning import turned_back
from camkit.models_def.optics.paraxial import trace_paraxial
from camkit.models_def.optics.pupil import PupilSamples, both_halves, half_disc
from camkit.models_def.optics.search.beam_launch import LEAD, launch_beam, leading
from camkit.models_def.optics.search.limits import (
    Limits,
    distortion_residuals,
    limit_residuals,
    ray_residuals,
)
from camkit.models_def.optics.search.spot_residuals import MERITS, Merit, spot_residuals
from camkit.models_def.optics.search.variables import FreeLens
from camkit.models_def.optics.trace import Rays, SurfaceTensors, trace

Change = Callable[[SurfaceTensors, SurfaceTensors], SurfaceTensors]


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """The merit and the limits that a search minimises.

    Attributes:
        free: The lens and its free numbers.
        slopes: (field,), tan of the field angles, the first one 0.
        wavelengths_um: (wave,), an odd number; the middle one judges distortion.
        object_distances_mm: Depths that count alike; empty for that of the lens. The sensor stays
            where the lens's own object distance puts it.
        samples: Of half the unit disc; with azimuths the other half is traced too.
        merit: Which merit of spots.
        core_mm: Its s.
        limits: What a lens must not be, seen from the depth that the sensor is focused on where
            that is looked at, else from the first one.
        merit_fields: How many fields, from the axis, the merit counts; 0 for all. The others only
            must pass their rays.
        vignetting: (field, 3), see `launch_beam`; None for whole pupils.
        azimuths_rad: (field,), of the images, from +y towards +x, as a lens that is not round
            needs them; None for +y, where half the pupil is enough.
    """

    free: FreeLens
    slopes: Tensor
    wavelengths_um: Tensor
    object_distances_mm: tuple[float, ...] = ()
    samples: PupilSamples = field(default_factory=lambda: half_disc(20))
    merit: Merit = "sum_abs"
    core_mm: float = 6e-3
    limits: Limits = field(default_factory=Limits)
    merit_fields: int = 0
    vignetting: Tensor | None = None
    azimuths_rad: Tensor | None = None

    def __post_init__(self) -> None:
        if self.merit not in MERITS:
            raise ContractError(f"a merit is one of {', '.join(MERITS)}; got {self.merit!r}")
        if len(self.wavelengths_um) % 2 == 0:
            raise ContractError("a problem needs an odd number of wavelengths")
        if not (self.core_mm > 0 and len(self.slopes) > 0 and float(self.slopes[0]) == 0):
            raise ContractError("a problem needs a core > 0 and fields that start at the axis")
        if self.azimuths_rad is None and not self.free.is_round:
            raise UnsupportedError(
                "half the pupil and fields along +y need a round lens, and this one has a free "
                "phase: `camkit design` takes fields at optics.azimuths_deg"
            )
        if self.azimuths_rad is not None and self.azimuths_rad.shape != self.slopes.shape:
            raise ContractError(
                f"{len(self.slopes)} fields need as many azimuths; got {len(self.azimuths_rad)}"
            )

    @property
    def whole_pupil(self) -> bool:
        """Return whether both halves of the pupil are traced."""
        return self.azimuths_rad is not None

    @property
    def depths_mm(self) -> tuple[float, ...]:
        """Return the object distances that are looked at."""
        return self.object_distances_mm or (self.free.lens.object_distance_mm,)

    @property
    def limited_mm(self) -> float:
        """Return the object distance from which the limits are judged.

        From another one the image lies off the sensor, larger or smaller: that is no distortion.
        """
        distance_mm = self.free.lens.object_distance_mm
        return distance_mm if distance_mm in self.depths_mm else self.depths_mm[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Traced:
    """A batch of lenses looked at from one object distance.

    Attributes:
        reference: The lenses at the reference wavelength.
        tensors: The lenses at all wavelengths.
        launched: The rays before the first surface, (start, field, 1, LEAD + ray).
        landings: (start, field, wave, LEAD + ray) on the sensor as it lies, see `beam`.
        surface_rays: The same on every surface.
    """

    reference: SurfaceTensors
    tensors: SurfaceTensors
    launched: Rays
    landings: Rays
    surface_rays: list[Rays]


def trace_batch(
    problem: Problem,
    scaled: Tensor,
    object_distance_mm: float,
    change: Change | None = None,
    *,
    path: bool = False,
) -> Traced:
    """Trace a batch (start, variable) from every field; gradients flow.

    Args:
        problem: Fields and wavelengths.
        scaled: The lenses.
        object_distance_mm: Of the object.
        change: Takes the lenses at all wavelengths and at the reference one, and gives the former
            as they are to be traced; None traces them as they are.
        path: Whether the landings carry optical paths.
    """
    free = problem.free
    reference_um = torch.tensor([free.lens.reference_wavelength_um], dtype=torch.float64)
    reference = free.tensors(scaled, reference_um)
    tensors = free.tensors(scaled, problem.wavelengths_um)
    if change is not None:
        tensors = change(tensors, reference)
    rays = launch_beam(
        free.lens,
        reference,
        problem.slopes,
        both_halves(problem.samples) if problem.whole_pupil else problem.samples,
        object_distance_mm,
        problem.vignetting,
        problem.azimuths_rad,
    )
    surface_rays: list[Rays] = []
    landings = trace(tensors, rays, surface_rays=surface_rays, path=path)
    return Traced(
        reference=reference,
        tensors=tensors,
        launched=rays,
        landings=landings,
        surface_rays=surface_rays,
    )


def valid_share(problem: Problem, scaled: Tensor) -> Tensor:
    """Return the share of rays that reach the sensor (start,), over fields, colours and depths."""
    with torch.no_grad():
        shares = [
            trace_batch(problem, scaled, d).landings.valid[..., LEAD:].double().flatten(1).mean(1)
            for d in problem.depths_mm
        ]
    return torch.stack(shares).mean(0)


def residuals(problem: Problem, scaled: Tensor) -> Tensor:
    """Return residuals (start, residual) of a batch (start, variable)."""
    parts: list[Tensor] = []
    for distance_mm in problem.depths_mm:
        traced = trace_batch(problem, scaled, distance_mm)
        spots = spot_residuals(
            traced.landings,
            problem.core_mm,
            problem.merit,
            fields=problem.merit_fields,
            whole_pupil=problem.whole_pupil,
        )
        parts.append(spots / math.sqrt(len(problem.depths_mm)))
        if distance_mm == problem.limited_mm:
            parts.append(limits_of(problem, traced, distance_mm))
    return torch.cat(parts, dim=1)


def limits_of(problem: Problem, traced: Traced, distance_mm: float) -> Tensor:
    """Return residuals (start, residual) of what the lenses must not be."""
    return torch.cat([*_limit_parts(problem, traced, distance_mm).values()], dim=1)


def broken_limits(problem: Problem, scaled: Tensor) -> dict[str, float]:
    """Return what a lens (variable,) pays for each limit that it breaks, as a sum of squares."""
    distance_mm = problem.limited_mm
    with torch.no_grad():
        traced = trace_batch(problem, scaled[None], distance_mm)
        parts = _limit_parts(problem, traced, distance_mm)
    costs = {key: float(part.square().sum()) for key, part in parts.items()}
    return {key: cost for key, cost in costs.items() if cost > 0}


def _limit_parts(problem: Problem, traced: Traced, distance_mm: float) -> dict[str, Tensor]:
    """Return the residuals (start, residual) of the limits by key; rays have none."""
    free, limits = problem.free, problem.limits
    parts = limit_residuals(
        limits,
        traced.tensors,
        traced.surface_rays,
        solved=free.solved,
        glass=tuple(s.glass != "air" for s in free.lens.surfaces),
    )
    parts["rays that are lost, or nearly"] = ray_residuals(
        traced.tensors,
        leading(traced.launched),
        [leading(rays) for rays in traced.surface_rays],
    )
    if math.isfinite(limits.distortion) and len(problem.slopes) > 1:
        middle = len(problem.wavelengths_um) // 2
        chief = _radial(problem, traced.landings)[:, 1:, middle]
        ideal = problem.slopes[1:] * image_scale_mm(traced.reference, distance_mm)
        parts["distortion"] = distortion_residuals(limits, chief, ideal)
    return parts


def _radial(problem: Problem, landings: Rays) -> Tensor:
    """Return how far along its azimuth each chief ray lands (start, field, wave)."""
    x, y = landings.x[..., 0], landings.y[..., 0]
    return (
        y if problem.azimuths_rad is None else turned_back(x, y, -problem.azimuths_rad[:, None])[1]
    )


def image_scale_mm(reference: SurfaceTensors, object_distance_mm: float) -> Tensor:
    """Return the paraxial image height per field slope (start, 1): the EFL for a distant object."""
    one = torch.ones_like(reference.index[0] * reference.curvature_per_mm[0])
    surfaces = range(len(reference.aspheric))
    _, slope = trace_paraxial(reference, one, one / object_distance_mm, surfaces)
    return (-1 / slope).reshape(-1, 1)
