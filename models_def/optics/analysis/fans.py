"""Ray fans: where the rays of two lines through the pupil land, and what their paths differ by.

The tangential fan lies in the meridional plane (pupil y), the sagittal fan across it (pupil x).
"""

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.analysis.spots import chief_landings, launch_beams
from camkit.models_def.optics.analysis.wavefront import trace_wavefront
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import PupilDefinition, PupilSamples
from camkit.models_def.optics.trace import trace

FAN_POINTS: Final = 41


@dataclass(frozen=True, slots=True, kw_only=True)
class Fans:
    """Two fans of every field and wavelength, (field, wavelength, point); NaN where lost.

    Attributes:
        pupil: (point,), -1 .. 1 of the pupil's radius.
        tangential_mm: y on the sensor from the chief ray of the reference wavelength.
        sagittal_mm: x on the sensor from it.
        tangential_opd_um: OPD against the chief ray of the wavelength; longer paths are negative.
        sagittal_opd_um: The same of the sagittal fan.
    """

    pupil: Tensor
    tangential_mm: Tensor
    sagittal_mm: Tensor
    tangential_opd_um: Tensor
    sagittal_opd_um: Tensor


def trace_fans(
    lens: Lens,
    slopes: Tensor,
    wavelengths_um: Tensor,
    definition: PupilDefinition = "stop",
    points: int = FAN_POINTS,
) -> Fans:
    """Trace the fans of fields and wavelengths.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
        wavelengths_um: (wavelength,).
        definition: Of the pupil.
        points: Of each fan, from rim to rim.
    """
    line = torch.linspace(-1, 1, points, dtype=torch.float64)
    none = torch.zeros_like(line)
    samples = PupilSamples(x=torch.cat([none, line]), y=torch.cat([line, none]))
    beams = launch_beams(lens, slopes, wavelengths_um, samples, definition)
    landings = trace(beams.tensors, beams.rays)
    reference = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    chief_mm = chief_landings(lens, slopes, reference, definition)[..., None]
    wavefront = trace_wavefront(lens, slopes, wavelengths_um, samples, definition)

    def alive(values: Tensor, mask: Tensor, part: slice) -> Tensor:
        return torch.where(mask, values, math.nan)[..., part]

    tangential, sagittal = slice(points), slice(points, None)
    lit = wavefront.flux > 0
    return Fans(
        pupil=line,
        tangential_mm=alive(landings.y - chief_mm, landings.valid, tangential),
        sagittal_mm=alive(landings.x, landings.valid & torch.isfinite(chief_mm), sagittal),
        tangential_opd_um=alive(wavefront.opd_um, lit, tangential),
        sagittal_opd_um=alive(wavefront.opd_um, lit, sagittal),
    )
