"""Curves over the field and over the wavelength.

Foci are measured from the sensor, positive away from the lens.
"""

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.analysis.first_order import ideal_heights
from camkit.models_def.optics.analysis.spots import (
    analysis_tensors,
    chief_landings,
    launch_beams,
    launch_near_chief,
)
from camkit.models_def.optics.paraxial import focal_lengths
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import PupilDefinition, PupilSamples
from camkit.models_def.optics.trace import trace

_CLOSE: Final = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldCurvature:
    """Foci of close rays about the chief ray, from the sensor along the axis.

    Attributes:
        tangential_mm: (field, wavelength), of rays in the meridional plane (Y-focus); NaN if the
            chief ray is lost, inf if they stay parallel.
        sagittal_mm: (field, wavelength), of rays across it (X-focus).
    """

    tangential_mm: Tensor
    sagittal_mm: Tensor


def field_curvature(
    lens: Lens, slopes: Tensor, wavelengths_um: Tensor, definition: PupilDefinition = "stop"
) -> FieldCurvature:
    """Trace rays close to the chief ray and find where they cross it.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
        wavelengths_um: (wavelength,).
        definition: Of the pupil; it says which ray is the chief ray.
    """
    zero = torch.zeros(1, dtype=torch.float64)
    step = torch.full_like(zero, _CLOSE)
    samples = PupilSamples(
        x=torch.cat([zero, step, zero, zero]), y=torch.cat([zero, zero, step, -step])
    )
    beams = launch_near_chief(lens, slopes, wavelengths_um, samples, definition)
    landings = trace(beams.tensors, beams.rays)
    alive = landings.valid.all(-1)
    x, y = landings.x, landings.y
    lean_x, lean_y = landings.l / landings.n, landings.m / landings.n
    tangential = -(y[..., 2] - y[..., 3]) / (lean_y[..., 2] - lean_y[..., 3])
    sagittal = -(x[..., 1] - x[..., 0]) / (lean_x[..., 1] - lean_x[..., 0])
    return FieldCurvature(
        tangential_mm=torch.where(alive, tangential, math.nan),
        sagittal_mm=torch.where(alive, sagittal, math.nan),
    )


def distortion(
    lens: Lens, slopes: Tensor, wavelengths_um: Tensor, definition: PupilDefinition
) -> Tensor:
    """Return chief height / ideal height - 1 (field, wavelength); 0 on the axis, NaN if lost.

    Heights count from where the axis lands, which an uneven lens shifts.

    The ideal height is the paraxial one of the reference wavelength where the sensor stands (see
    `ideal_heights`), so lateral colour shows as a difference between wavelengths.
    """
    from_axis = torch.cat([slopes.new_zeros(1), slopes])
    heights = chief_landings(lens, from_axis, wavelengths_um, definition)
    heights = heights[1:] - torch.nan_to_num(heights[:1])
    ideal = ideal_heights(lens, slopes)[:, None]
    off_axis = torch.abs(slopes[:, None]) > 0
    share = heights / torch.where(off_axis, ideal, 1.0) - 1
    return torch.where(off_axis | ~torch.isfinite(heights), share, 0.0)


def lateral_colour_mm(
    lens: Lens, slopes: Tensor, wavelengths_um: Tensor, definition: PupilDefinition
) -> Tensor:
    """Return the distances (field, wavelength) of chief rays from the reference wavelength's."""
    reference = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    heights = chief_landings(lens, slopes, torch.cat([wavelengths_um, reference]), definition)
    return heights[:, :-1] - heights[:, -1:]


def axial_colour_mm(lens: Lens, wavelengths_um: Tensor) -> Tensor:
    """Return the paraxial focus (wavelength,) beyond that of the reference wavelength."""
    reference = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    foci = _paraxial_foci(lens, torch.cat([wavelengths_um, reference]))
    return foci[:-1] - foci[-1]


def _paraxial_foci(lens: Lens, wavelengths_um: Tensor) -> Tensor:
    axis = torch.zeros(1, dtype=torch.float64)
    if math.isinf(lens.object_distance_mm):
        return focal_lengths(analysis_tensors(lens, wavelengths_um))[1]
    foci = field_curvature(lens, axis, wavelengths_um, "paraxial")
    return foci.sagittal_mm[0] + lens.surfaces[-1].thickness_mm


def longitudinal_mm(lens: Lens, pupil: Tensor, wavelengths_um: Tensor) -> Tensor:
    """Return where axial rays cross the axis (wavelength, pupil), from the sensor; NaN if lost.

    The axis is the ray through the middle of the pupil, which an uneven lens bends.

    Args:
        lens: The prescription.
        pupil: (pupil,), heights in the paraxial entrance pupil, > 0..1.
        wavelengths_um: (wavelength,).
    """
    axis = torch.zeros(1, dtype=torch.float64)
    heights = torch.cat([axis, pupil])
    samples = PupilSamples(x=torch.zeros_like(heights), y=heights)
    beams = launch_beams(lens, axis, wavelengths_um, samples, "paraxial")
    landings = trace(beams.tensors, beams.rays)
    lean, y = landings.m / landings.n, landings.y
    crossing = -(y[..., 1:] - y[..., :1]) / (lean[..., 1:] - lean[..., :1])
    return torch.where(landings.valid[..., 1:], crossing, math.nan)[0]
