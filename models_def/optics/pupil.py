"""Rays through the pupil: samples, launching, aiming.

Three definitions of the pupil; spots and PSFs differ by them, so each states its own.

- `stop`: each ray passes the stop surface at its own sample point, and a ray's weight is the area
  of the beam in the entrance plane (the vertex plane of the first surface) that belongs to it.
  This is what a real stop does, so vignetting and pupil aberration come out right; every frozen
  PSF and relative illumination of camkit uses it. The stop's radius is the height of the paraxial
  marginal ray there, or, asked for by `real_stop_radius_mm`, of the real one.
- `chief`: the ray through the middle is aimed at the middle of the stop; around it the rays fill
  a disc of the entrance pupil's diameter.
- `paraxial`: the rays fill the paraxial entrance pupil.
"""

import math
from dataclasses import dataclass, replace
from typing import Final, Literal, get_args

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.aim import aim
from camkit.models_def.optics.aiming.field import lead_factor
from camkit.models_def.optics.aiming.newton import Aim
from camkit.models_def.optics.aiming.start import launch, with_open_apertures
from camkit.models_def.optics.paraxial import Paraxial, paraxial_data
from camkit.models_def.optics.prescription import Lens, require_plain
from camkit.models_def.optics.trace import (
    Fate,
    Rays,
    SurfaceTensors,
    refract,
    surface_tensors,
    trace,
)

PupilDefinition = Literal["paraxial", "chief", "stop"]
PUPIL_DEFINITIONS: Final[tuple[PupilDefinition, ...]] = get_args(PupilDefinition)

_GOLDEN_ANGLE_RAD: Final = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True, slots=True, kw_only=True)
class PupilSamples:
    """Points of the unit disc.

    Attributes:
        x: (rays,) float64.
        y: (rays,) float64.
        weight: (rays,), share of the disc that a point stands for; equal shares if None.
    """

    x: Tensor
    y: Tensor
    weight: Tensor | None = None


def half_disc(rays: int) -> PupilSamples:
    """Return stratified points of the half disc x > 0, each with the same area.

    Points lie on the Fibonacci spiral, folded at x = 0: no random draw, no rows.
    """
    if rays < 1:
        raise ContractError(f"a pupil needs at least one ray; got {rays}")
    number = torch.arange(rays, dtype=torch.float64)
    radius = torch.sqrt((number + 0.5) / rays)
    angle = number * _GOLDEN_ANGLE_RAD
    return PupilSamples(x=torch.abs(radius * torch.cos(angle)), y=radius * torch.sin(angle))


def hexapolar(rings: int) -> PupilSamples:
    """Return a centre point and rings of 6, 12, ... points (the sampling of other programs)."""
    xs, ys = [0.0], [0.0]
    for ring in range(1, rings + 1):
        for i in range(6 * ring):
            angle = 2 * math.pi * i / (6 * ring)
            xs.append(ring / rings * math.cos(angle))
            ys.append(ring / rings * math.sin(angle))
    return PupilSamples(
        x=torch.tensor(xs, dtype=torch.float64), y=torch.tensor(ys, dtype=torch.float64)
    )


def both_halves(half: PupilSamples) -> PupilSamples:
    """Return points of the half disc x > 0 and their mirror images."""
    return PupilSamples(x=torch.cat([half.x, -half.x]), y=torch.cat([half.y, half.y]))


def pupil_centre() -> PupilSamples:
    """Return the middle of the disc, where chief rays pass."""
    zero = torch.zeros(1, dtype=torch.float64)
    return PupilSamples(x=zero, y=zero)


def with_fixed_stop(lens: Lens) -> Lens:
    """Return the lens with its aperture stated as the stop's size, as metal keeps it."""
    require_plain(lens, "a stop of fixed size")
    stop_mm = paraxial_data(lens).stop_semi_diameter_mm
    return replace(lens, aperture_kind="stop_semi_diameter_mm", aperture_value=stop_mm)


def real_stop_radius_mm(lens: Lens) -> float:
    """Return the height at the stop of the real marginal ray of the reference wavelength.

    The ray starts on the axis and meets the edge of the paraxial entrance pupil; a lens that
    states its stop keeps that.

    Raises:
        ContractError: If that ray is lost before the stop.
    """
    if lens.aperture_kind == "stop_semi_diameter_mm":
        return lens.aperture_value
    wave = torch.tensor(lens.reference_wavelength_um, dtype=torch.float64)
    tensors = with_open_apertures(surface_tensors(lens, wave))
    zero = torch.zeros((), dtype=torch.float64)
    rays = launch(zero, zero + beam_radius_mm(lens), zero, lens.object_distance_mm)
    met = refract(tensors, trace(tensors, rays, surfaces=range(lens.stop)), lens.stop)
    if not bool(met.valid):
        raise ContractError(
            "the real marginal ray is lost before the stop; make the aperture smaller or state "
            "stop_semi_diameter_mm"
        )
    return abs(float(met.y))


def beam_radius_mm(lens: Lens) -> float:
    """Return the radius in the first vertex plane of the axial beam into the entrance pupil."""
    data = paraxial_data(lens)
    return data.entrance_pupil_diameter_mm / 2 * _vertex_scale(lens, data)


def _vertex_scale(lens: Lens, data: Paraxial) -> float:
    """Return the height in the first vertex plane of an axial ray of height 1 in the pupil."""
    if math.isinf(lens.object_distance_mm):
        return 1.0
    return lens.object_distance_mm / (lens.object_distance_mm + data.entrance_pupil_mm)


def pupil_rays(
    lens: Lens,
    tensors: SurfaceTensors,
    samples: PupilSamples,
    slope: Tensor,
    *,
    definition: PupilDefinition = "stop",
    stop_radius_mm: float | None = None,
) -> tuple[Rays, Tensor]:
    """Return launched rays and their weights.

    Args:
        lens: The prescription (stop, aperture, object distance).
        tensors: Its tensors; batch dimensions broadcast with slope, the last being rays.
        samples: Of the unit disc, (rays,).
        slope: tan of the field angle (`field_slope`), (..., 1).
        definition: See the module.
        stop_radius_mm: For the definition `stop`; that of the paraxial marginal ray by default.

    Returns:
        Rays (..., rays) where `launch` starts them, and the areas of their beams there in equal
        units, of the same shape; rays that cannot be aimed have weight 0 and fate MISSED.
    """
    data = paraxial_data(lens)
    share = 1.0 if samples.weight is None else samples.weight * len(samples.weight)
    if definition == "stop":
        radius = data.stop_semi_diameter_mm if stop_radius_mm is None else stop_radius_mm
        aimed = _aim_at(lens, tensors, samples, slope, radius)
        x, y, weight = aimed.x, aimed.y, aimed.weight * share
    else:
        scale = _vertex_scale(lens, data)
        radius = data.entrance_pupil_diameter_mm / 2 * scale
        x = samples.x * radius + torch.zeros_like(slope)
        middle = -data.entrance_pupil_mm * scale * lead_factor(slope)
        weight = torch.ones_like(x) * share
        if definition == "chief":
            centre = PupilSamples(x=torch.zeros_like(samples.x[:1]), y=torch.zeros_like(x[..., :1]))
            chief = _aim_at(lens, tensors, centre, slope, 1.0)
            middle, weight = chief.y, torch.where(chief.weight > 0, weight, 0.0)
        y = samples.y * radius + middle
    rays = launch(x, y, slope, lens.object_distance_mm)
    if definition == "paraxial":
        return rays, torch.ones_like(rays.x) * share
    return marked(rays, weight), weight


def marked(rays: Rays, weight: Tensor) -> Rays:
    """Return launched rays; those without weight, which could not be aimed, as missed."""
    fate = torch.where(weight > 0, int(Fate.VALID), int(Fate.MISSED)).to(torch.int8)
    return replace(rays, fate=fate)


def _aim_at(
    lens: Lens, tensors: SurfaceTensors, samples: PupilSamples, slope: Tensor, radius_mm: float
) -> Aim:
    target = (samples.x * radius_mm, samples.y * radius_mm)
    return aim(lens, tensors, target, slope)
