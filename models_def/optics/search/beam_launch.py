"""Rays of a batch of lenses: the paraxial entrance pupil filled from every field.

The search needs a pupil whose rays depend smoothly on the lens and cost no aiming; what a real
stop passes is measured afterwards (`pupil`, definition `stop`).
"""

import math
from dataclasses import replace
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.asymmetric.turning import turned_back
from camkit.models_def.optics.paraxial import entrance_pupil, focal_lengths
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import PupilSamples
from camkit.models_def.optics.trace import Rays, SurfaceTensors

LEAD_X: Final = (0.0, 0.0, 0.0, 1.0)
LEAD_Y: Final = (0.0, 1.0, -1.0, 0.0)
LEAD: Final = len(LEAD_X)


def pupil_radius_mm(lens: Lens, reference: SurfaceTensors, magnification: Tensor) -> Tensor:
    """Return the radius of the entrance pupil in the batch shape.

    Args:
        lens: States the aperture.
        reference: The batch at the reference wavelength.
        magnification: Of the stop, see `entrance_pupil`.
    """
    if lens.aperture_kind == "stop_semi_diameter_mm":
        return lens.aperture_value * torch.abs(magnification)
    if lens.aperture_kind == "f_number":
        return torch.abs(focal_lengths(reference)[0]) / lens.aperture_value / 2
    return torch.full_like(magnification, lens.aperture_value / 2)


def launch_beam(
    lens: Lens,
    reference: SurfaceTensors,
    slopes: Tensor,
    samples: PupilSamples,
    object_distance_mm: float,
    vignetting: Tensor | None = None,
    azimuths_rad: Tensor | None = None,
) -> Rays:
    """Start rays at the first vertex plane: (start, field, 1, LEAD + ray).

    The first rays lead: the chief ray, then the rim (above, below, beside). They bound the beam,
    for limits; merits leave them out.

    Args:
        lens: States stop and aperture.
        reference: (surface, start, 1, 1, 1) at the reference wavelength.
        slopes: (field,), tan of the field angles seen from the entrance pupil's axis point for a
            distant object, from the first vertex for a near one (as `launch`).
        samples: Of the unit disc, (ray,).
        object_distance_mm: From the first vertex; inf allowed.
        vignetting: (field, 3), what of the pupil a field fills: its middle's y, and its extent
            along y and x, in radii of the pupil; None for the whole pupil. The chief ray stays.
        azimuths_rad: (field,), of the images of the fields, from +y towards +x; None for +y.
    """
    place, magnification = entrance_pupil(reference, lens.stop)
    radius = pupil_radius_mm(lens, reference, magnification)
    lead_x = torch.tensor(LEAD_X, dtype=samples.x.dtype)
    lead_y = torch.tensor(LEAD_Y, dtype=samples.x.dtype)
    unit_x, unit_y = torch.cat([lead_x, samples.x]), torch.cat([lead_y, samples.y])
    if vignetting is not None:
        shift, along_y, along_x = (part[:, None, None] for part in vignetting.unbind(1))
        unit_y = torch.cat([0 * shift, (shift + along_y * unit_y)[..., 1:]], dim=-1)
        unit_x = along_x * unit_x
    px, py = radius * unit_x, radius * unit_y
    slope = slopes[:, None, None]
    if math.isinf(object_distance_mm):
        rays = launch(px, py - place * slope, slope, object_distance_mm)
        return _turned(rays, azimuths_rad)
    share = object_distance_mm / (object_distance_mm + place)
    top = -slope * object_distance_mm
    rays = launch(px * share, top + (py - top) * share, slope, object_distance_mm)
    return _turned(rays, azimuths_rad)


def _turned(rays: Rays, azimuths_rad: Tensor | None) -> Rays:
    """Return rays (..., field, wave, ray) of fields along +y, each turned to its azimuth."""
    if azimuths_rad is None:
        return rays
    azimuths = azimuths_rad[:, None, None]
    x, y = turned_back(rays.x, rays.y, azimuths)
    along_x, along_y = turned_back(rays.l, rays.m, azimuths)
    return replace(rays, x=x, y=y, l=along_x, m=along_y)


def leading(rays: Rays) -> Rays:
    """Return the rays that bound the beam, of rays (..., LEAD + ray)."""
    parts = (rays.x, rays.y, rays.z, rays.l, rays.m, rays.n)
    x, y, z, along_x, along_y, along_z = (part[..., :LEAD] for part in parts)
    return Rays(x=x, y=y, z=z, l=along_x, m=along_y, n=along_z, fate=rays.fate[..., :LEAD])
