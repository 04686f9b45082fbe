"""Relative illumination of the sensor by an even scene.

Rays run backwards, from a point of the sensor to points of the stop. Each brings the radiance of
the scene through its own share of the solid angle, wherever in the scene it ends. This is right
for blurred images too; landing the whole beam of a field at its chief ray is not (0.875 instead of
0.897 at the corner of `duet`, seen from 1 m).
"""

from dataclasses import replace

import torch
from torch import Tensor

from camkit.models_def.optics.aiming.field import is_steep
from camkit.models_def.optics.aiming.newton import newton_aim
from camkit.models_def.optics.aiming.start import with_open_apertures
from camkit.models_def.optics.analysis.spots import analysis_tensors, chief_landings
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import with_object_distance
from camkit.models_def.optics.pupil import half_disc, real_stop_radius_mm
from camkit.models_def.optics.render.beam import light_of, rays_from, stop_labels
from camkit.models_def.optics.render.lens_view import lens_optics
from camkit.models_def.optics.reverse import reverse, trace_to_scene
from camkit.models_def.optics.trace import Rays, refract, trace


def relative_illumination_of(
    lens: Lens, slopes: Tensor, wavelengths_um: Tensor, rays: int = 1024
) -> Tensor:
    """Return the light (field, wavelength) of an even scene, 1 on the axis; NaN without chief ray.

    Measured on the sensor where the chief ray of the field lands. The stop decides what passes,
    whatever the pupil of the spots. Losses of coating and bulk are not counted.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
        wavelengths_um: (wavelength,).
        rays: In half the stop.

    Raises:
        ContractError: If the stop has no real radius or is imaged onto the sensor.
    """
    heights = chief_landings(lens, slopes, wavelengths_um, "stop")
    axis = torch.zeros_like(heights[:1])
    steep = bool(is_steep(slopes).any())
    light = sensor_light(lens, torch.cat([axis, heights]), wavelengths_um, rays, steep=steep)
    return light[1:] / light[:1]


def relative_illumination_at(lens: Lens, heights_mm: Tensor, rays: int = 1024) -> Tensor:
    """Return the light (point,) of an even scene at sensor heights (point,), 1 on the axis.

    At the reference wavelength; otherwise as `relative_illumination_of`.
    """
    heights = torch.cat([heights_mm.new_zeros(1), heights_mm]).to(torch.float64)[:, None]
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    light = sensor_light(lens, heights, wave, rays)[:, 0]
    return light[1:] / light[0]


def sensor_light(
    lens: Lens,
    heights_mm: Tensor,
    wavelengths_um: Tensor,
    rays: int = 1024,
    *,
    steep: bool = False,
) -> Tensor:
    """Return the irradiance (point, wavelength) of a scene of radiance 1; NaN where the height is.

    The integral of `render.beam`, whose labels are found here by aiming at even shares of the
    stop: no search, no ray that misses it.

    Args:
        lens: The prescription.
        heights_mm: (point, wavelength), of points of the sensor.
        wavelengths_um: (wavelength,).
        rays: In half the stop, which the other half mirrors.
        steep: Whether light comes from fields beyond 89.5 degrees too.
    """
    finite = torch.isfinite(heights_mm)
    place = torch.where(finite, heights_mm, 0.0)[..., None]
    tensors = analysis_tensors(lens, wavelengths_um[:, None])
    back, count = reverse(with_open_apertures(tensors)), len(tensors.aspheric) - 1 - lens.stop
    radius_mm, samples = real_stop_radius_mm(lens), half_disc(rays)
    x, y = radius_mm * samples.x, radius_mm * samples.y
    # where the object lies does not matter to the labels
    labels = stop_labels(lens_optics(with_object_distance(lens, 1.0)))
    to_label = 1 / labels.radius_mm

    def at_stop(label_x: Tensor, label_y: Tensor) -> Rays:
        rays = rays_from(labels, 0 * place, place, label_x * to_label, label_y * to_label)
        rays = replace(rays, z=rays.z - tensors.thickness_mm[-1])
        return refract(back, trace(back, rays, surfaces=range(count)), count)

    with torch.no_grad():
        aimed = newton_aim(at_stop, (x, y), (x + 0 * place, y + 0 * place))
        start = rays_from(labels, 0 * place, place, aimed.x * to_label, aimed.y * to_label)
        end = trace_to_scene(tensors, start, lens.object_distance_mm, steep=steep)
        share = (light_of(start, end) * aimed.weight).mean(-1)
        light = labels.area * (radius_mm * to_label) ** 2 * share
    return torch.where(finite, light, torch.nan)
