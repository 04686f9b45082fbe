"""Optical path differences against the reference sphere at the exit pupil.

The sphere is centred where the chief ray of the reference wavelength meets the sensor and passes
the middle of the paraxial exit pupil. Sign: a ray whose path is longer than the chief ray's has a
negative OPD, as in CODE V's listings.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.start import launch, launch_points, path_before
from camkit.models_def.optics.analysis.spots import (
    Beams,
    chief_landings,
    launch_beams,
    launch_near_chief,
)
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import PupilDefinition, PupilSamples, pupil_centre
from camkit.models_def.optics.trace import Rays, SurfaceTensors, trace
from camkit.units import UM_PER_MM

_NO_SPHERE_MM2: Final = 1e-12
_DIFFERENCE_MM: Final = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Wavefront:
    """The light that converges on the sensor, ray by ray.

    Attributes:
        l: (field, wavelength, rays), direction cosine in x from the reference sphere towards its
            centre.
        m: The same in y.
        opd_um: (field, wavelength, rays); 0 on the chief ray of the wavelength.
        flux: (field, wavelength, rays), energy of each ray: the area in mm^2 of its beam as it
            enters; 0 if lost.
        amplitude: (field, wavelength, rays), share of each ray in a sum of waves: the root of
            flux times the solid angle d l d m that the ray stands for.
        miss_mm: (field, wavelength, rays), distance from the centre at which rays land.
        wavelengths_um: (wavelength,).
        centre_mm: (field,), height of the sphere's centre on the sensor.
    """

    l: Tensor  # noqa: E741
    m: Tensor
    opd_um: Tensor
    flux: Tensor
    amplitude: Tensor
    miss_mm: Tensor
    wavelengths_um: Tensor
    centre_mm: Tensor


def path_lengths(
    tensors: SurfaceTensors,
    rays: Rays,
    slope: Tensor,
    distance_mm: float,
    surface_rays: list[Rays] | None = None,
) -> tuple[Rays, Tensor]:
    """Trace rays to the sensor and return their optical path lengths in mm.

    Args:
        tensors: The lens.
        rays: At the first vertex plane.
        slope: tan of their field angle.
        distance_mm: Of the object, inf allowed.
        surface_rays: Receives the rays on each surface, see `trace`.

    Returns:
        The rays on the sensor, and their paths (n times length) since they left the object's
        wave through the first vertex.
    """
    landings = trace(tensors, rays, path=True, surface_rays=surface_rays)
    if landings.path_mm is None:
        raise ContractError("the tracer gave no optical path")
    return landings, path_before(rays, slope, distance_mm, tensors.index[0]) + landings.path_mm


def trace_wavefront(
    lens: Lens,
    slopes: Tensor,
    wavelengths_um: Tensor,
    samples: PupilSamples,
    definition: PupilDefinition = "stop",
) -> Wavefront:
    """Trace the wavefronts of fields and wavelengths.

    The amplitude follows from the energy of each ray and the solid angle it spreads over, which
    two rays close to it tell.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
        wavelengths_um: (wavelength,).
        samples: Of the unit disc, (rays,).
        definition: Of the pupil.
    """
    reference = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    centre = chief_landings(lens, slopes, reference, definition)[:, 0]
    beams = launch_beams(lens, slopes, wavelengths_um, samples, definition)
    here = _at_sphere(lens, beams, slopes, centre)
    right, upper = (
        _at_sphere(lens, replace(beams, rays=_shifted(lens, beams, slopes, *step)), slopes, centre)
        for step in ((_DIFFERENCE_MM, 0.0), (0.0, _DIFFERENCE_MM))
    )
    spread = (right.l - here.l) * (upper.m - here.m) - (right.m - here.m) * (upper.l - here.l)
    middle = chief_path_mm(lens, slopes, wavelengths_um, centre, definition)
    opd = (middle - here.path) * UM_PER_MM
    # without a chief ray there is nothing to measure from
    alive = here.valid & torch.isfinite(opd)
    flux = torch.where(alive, beams.area_mm2, 0.0)
    close = alive & right.valid & upper.valid
    density = torch.where(close, torch.abs(spread), 0.0) / _DIFFERENCE_MM**2
    return Wavefront(
        l=torch.where(alive, here.l, 0.0),
        m=torch.where(alive, here.m, 0.0),
        opd_um=torch.where(alive, opd, 0.0),
        flux=flux,
        amplitude=flux * torch.sqrt(density),
        miss_mm=torch.where(alive, here.miss_mm, 0.0),
        wavelengths_um=wavelengths_um,
        centre_mm=centre,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class AtSphere:
    """Rays on the reference sphere.

    Attributes:
        l: Direction cosine in x from the sphere towards its centre.
        m: The same in y.
        path: Optical path up to the sphere in mm.
        miss_mm: Distance from the centre at which rays land.
        valid: Whether they reach the sensor.
    """

    l: Tensor  # noqa: E741
    m: Tensor
    path: Tensor
    miss_mm: Tensor
    valid: Tensor


def _at_sphere(lens: Lens, beams: Beams, slopes: Tensor, centre_mm: Tensor) -> AtSphere:
    """Trace beams and carry them from the sensor back to the reference sphere."""
    landings, path = path_lengths(
        beams.tensors, beams.rays, slopes[:, None, None], lens.object_distance_mm
    )
    middle, radius = centre_mm[:, None, None], sphere_radius_mm(lens)
    return to_sphere(landings, path, middle, radius, beams.tensors.index[-1])


def sphere_radius_mm(lens: Lens) -> float:
    """Return the signed distance of the sensor from the paraxial exit pupil; inf is allowed."""
    return lens.surfaces[-1].thickness_mm - paraxial_data(lens).exit_pupil_mm


def to_sphere(
    landings: Rays, path: Tensor, centre_mm: Tensor, radius_mm: float, index: Tensor
) -> AtSphere:
    """Move rays from the sensor back to the reference sphere.

    Args:
        landings: On the sensor.
        path: Their optical paths in mm.
        centre_mm: Height of the sphere's centre; broadcasts against the rays.
        radius_mm: Of the sphere about the middle of the sensor, see `sphere_radius_mm`.
        index: Of the medium before the sensor.
    """
    x, y = landings.x, landings.y - centre_mm
    ahead, square = x * landings.l + y * landings.m, x**2 + y**2
    valid = landings.valid
    if not math.isfinite(radius_mm):
        # the pupil is at infinity: directions are those of the rays
        excess, direction = ahead, (landings.l, landings.m)
    else:
        radius = math.copysign(1.0, radius_mm) * torch.sqrt(radius_mm**2 + centre_mm**2)
        rest = radius**2 + ahead**2 - square
        # a sensor in the exit pupil: the sphere is too small for its rays
        valid = valid & (rest > _NO_SPHERE_MM2)
        bend = torch.sqrt(rest.clamp_min(_NO_SPHERE_MM2))
        root = math.copysign(1.0, radius_mm) * bend
        # the way back to the sphere, less its radius, without the loss of a difference
        excess = ahead + (ahead**2 - square) / (root + radius)
        way = radius + excess
        direction = ((way * landings.l - x) / radius, (way * landings.m - y) / radius)
    return AtSphere(
        l=direction[0],
        m=direction[1],
        path=path - index * excess,
        miss_mm=torch.sqrt(square.detach()),
        valid=valid,
    )


def _shifted(lens: Lens, beams: Beams, slopes: Tensor, dx: float, dy: float) -> Rays:
    rays = beams.rays
    slope = slopes[:, None, None]
    x, y = launch_points(rays, slope)
    shifted = launch(x + dx, y + dy, slope, lens.object_distance_mm)
    return replace(shifted, fate=rays.fate)


def chief_path_mm(
    lens: Lens,
    slopes: Tensor,
    wavelengths_um: Tensor,
    centre_mm: Tensor,
    definition: PupilDefinition,
) -> Tensor:
    """Return the paths (field, wavelength, 1) of chief rays to the reference sphere."""
    beams = launch_near_chief(lens, slopes, wavelengths_um, pupil_centre(), definition)
    return _at_sphere(lens, beams, slopes, centre_mm).path


def wavefront_rms_um(wavefront: Wavefront) -> Tensor:
    """Return the RMS (field, wavelength) of the OPD in um, its mean and tilt taken out.

    Rays count by their solid angle. NaN for fewer than four rays.
    """
    opd = without_tilt(wavefront).opd_um
    weight = wavefront.amplitude
    rms = torch.sqrt((weight * opd**2).sum(-1) / weight.sum(-1))
    return torch.where((weight > 0).sum(-1) > 3, rms, math.nan)


def without_tilt(wavefront: Wavefront) -> Wavefront:
    """Return the wavefront with its mean and its slope in l and m taken out (least squares)."""
    weight = torch.sqrt(wavefront.amplitude)[..., None]
    columns = torch.stack([torch.ones_like(wavefront.l), wavefront.l, wavefront.m], dim=-1)
    solution = torch.linalg.lstsq(
        columns * weight, wavefront.opd_um[..., None] * weight, driver="gelsd"
    ).solution
    return replace(wavefront, opd_um=wavefront.opd_um - (columns @ solution)[..., 0])
