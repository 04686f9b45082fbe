"""The PSF model of a lens: rays where the blur is wide against the Airy disc, waves where not."""

from dataclasses import dataclass
from typing import Final, Literal

import torch
from torch import Tensor

from camkit.models_def.optics.analysis.first_order import airy_radius_mm
from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.spots import rms_about_centroid, spot_diagram
from camkit.models_def.optics.prescription import Lens
from camkit.units import UM_PER_MM

PsfRegime = Literal["geometric", "wave"]

WAVE_BELOW: Final = 5.0
"""RMS blur over Airy radius below which diffraction shows in a PSF; see docs/results/lens.md."""
_BLUR_SAMPLING: Final = "gauss:6x16"


@dataclass(frozen=True, slots=True, kw_only=True)
class PsfModel:
    """The PSF model that a lens needs, and the reason.

    Attributes:
        regime: The cheaper one that is right for every field and wavelength.
        blur_mm: (field, wavelength), RMS radius of the geometric spot; NaN without rays.
        airy_mm: (wavelength,), radius of the Airy disc on the axis.
        reason: One sentence with the numbers that decide.
    """

    regime: PsfRegime
    blur_mm: Tensor
    airy_mm: Tensor
    reason: str


def psf_model(lens: Lens, slopes: Tensor, wavelengths_um: Tensor) -> PsfModel:
    """Return the PSF model that a lens needs.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
        wavelengths_um: (wavelength,).
    """
    pupil = Pupil(definition="paraxial", sampling=_BLUR_SAMPLING)
    blur = rms_about_centroid(spot_diagram(lens, slopes, wavelengths_um, pupil))
    airy = torch.tensor([airy_radius_mm(lens, w) for w in wavelengths_um.tolist()])
    ratio = torch.nan_to_num(blur / airy, nan=torch.inf)
    least = int(ratio.argmin())
    field, wave = divmod(least, len(wavelengths_um))
    regime: PsfRegime = "wave" if float(ratio.min()) < WAVE_BELOW else "geometric"
    side = "less" if regime == "wave" else "no less"
    reason = (
        f"{regime}: the sharpest spot (field {field + 1}, {float(wavelengths_um[wave]):g} um) has "
        f"an RMS radius of {float(blur[field, wave]) * UM_PER_MM:.2f} um, "
        f"{float(ratio[field, wave]):.2g} times the Airy radius of "
        f"{float(airy[wave]) * UM_PER_MM:.2f} um, {side} than {WAVE_BELOW:g} times"
    )
    if not bool(torch.isfinite(ratio).any()):
        reason = "geometric: no ray arrives at any field, so there is nothing to compare"
    return PsfModel(regime=regime, blur_mm=blur, airy_mm=airy, reason=reason)
