"""Paraxial rays of a lens for an object at any distance, and what follows from them."""

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.field import is_steep
from camkit.models_def.optics.aiming.start import launch, with_open_apertures
from camkit.models_def.optics.paraxial import paraxial_data, trace_paraxial
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.trace import SurfaceTensors, surface_tensors, trace
from camkit.units import UM_PER_MM

AIRY: Final = 1.21966989


@dataclass(frozen=True, slots=True, kw_only=True)
class ParaxialRay:
    """Heights in mm on every surface and slopes dy/dz before it; the last slope is in the image.

    Attributes:
        height_mm: (surface,).
        slope: (surface + 1,).
    """

    height_mm: Tensor
    slope: Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class ParaxialRays:
    """The two rays that third-order theory needs.

    Attributes:
        tensors: The lens at the wavelength of the rays.
        marginal: From the axis of the object to the edge of the entrance pupil.
        chief: From the edge of the field, from below, through the middle of the entrance pupil.
    """

    tensors: SurfaceTensors
    marginal: ParaxialRay
    chief: ParaxialRay

    @property
    def invariant_mm(self) -> Tensor:
        """The Lagrange invariant n (u ybar - ubar y), in the object; negative for fields > 0."""
        u, ubar = self.marginal.slope[0], self.chief.slope[0]
        y, ybar = self.marginal.height_mm[0], self.chief.height_mm[0]
        return self.tensors.index[0] * (u * ybar - ubar * y)


def paraxial_rays(lens: Lens, slope: float, wavelength_um: float | None = None) -> ParaxialRays:
    """Trace the paraxial marginal and chief ray.

    Args:
        lens: The prescription.
        slope: tan of the field angle, as seen from the first vertex.
        wavelength_um: The reference wavelength by default.

    Raises:
        ContractError: If the entrance pupil is at infinity.
    """
    data = paraxial_data(lens)
    if not math.isfinite(data.entrance_pupil_mm):
        raise ContractError(
            "the entrance pupil lies at infinity (telecentric object side); third-order theory "
            "needs a finite one: move the stop"
        )
    wave = lens.reference_wavelength_um if wavelength_um is None else wavelength_um
    tensors = surface_tensors(lens, torch.tensor(wave, dtype=torch.float64))
    distant = math.isinf(lens.object_distance_mm)
    way = 1.0 if distant else lens.object_distance_mm + data.entrance_pupil_mm
    scale = 1.0 if distant else lens.object_distance_mm / way
    height = data.entrance_pupil_diameter_mm / 2 * scale
    lean = slope * scale
    return ParaxialRays(
        tensors=tensors,
        marginal=_paraxial_ray(
            tensors, height, 0.0 if distant else height / lens.object_distance_mm
        ),
        chief=_paraxial_ray(tensors, -data.entrance_pupil_mm * lean, lean),
    )


def _paraxial_ray(tensors: SurfaceTensors, height_mm: float, slope: float) -> ParaxialRay:
    y = torch.tensor(height_mm, dtype=torch.float64)
    u = torch.tensor(slope, dtype=torch.float64)
    heights, slopes = [y], [u]
    for i in range(len(tensors.aspheric)):
        if i:
            y = y + tensors.thickness_mm[i - 1] * u
            heights.append(y)
        _, u = trace_paraxial(tensors, y, u, range(i, i + 1))
        slopes.append(u)
    return ParaxialRay(height_mm=torch.stack(heights), slope=torch.stack(slopes))


def ideal_heights(lens: Lens, slopes: Tensor) -> Tensor:
    """Return the heights (field,) in mm of the paraxial chief rays on the sensor where it stands.

    For a distant object and a sensor in the paraxial focus this is EFL tan(angle); out of focus
    it is scaled as the chief ray is, so that defocus is not taken for distortion. NaN for steep
    fields, which no plane images.
    """
    chief = paraxial_rays(lens, 1.0).chief
    tangents = torch.where(is_steep(slopes), torch.nan, slopes)
    return tangents * (chief.height_mm[-1] + lens.surfaces[-1].thickness_mm * chief.slope[-1])


def airy_radius_mm(lens: Lens, wavelength_um: float | None = None) -> float:
    """Return the radius of the first dark ring on the axis, 1.22 wavelength / (2 NA).

    NA is the sine of the real marginal ray in the image (of the paraxial one if that is lost):
    a near object's working aperture is counted; inf if the lens makes no cone.
    """
    wave = lens.reference_wavelength_um if wavelength_um is None else wavelength_um
    rays = paraxial_rays(lens, 0.0, wave)
    height = rays.marginal.height_mm[0]
    zero = torch.zeros_like(height)
    real = trace(
        with_open_apertures(rays.tensors), launch(zero, height, zero, lens.object_distance_mm)
    )
    slope = float(rays.marginal.slope[-1])
    aperture = abs(float(real.m)) if bool(real.valid) else abs(slope) / math.hypot(1.0, slope)
    return AIRY * wave / UM_PER_MM / (2 * aperture) if aperture else math.inf
