"""The PSF of a lens by rays or by waves, at heights on the sensor."""

import math
from typing import Final

import torch
import torch.nn.functional as tf
from torch import Tensor

from camkit.models_def.optics.analysis.first_order import AIRY
from camkit.models_def.optics.analysis.lens_waves import wave_psf
from camkit.models_def.optics.analysis.psf_model import (
    WAVE_BELOW,
    PsfModel,
    PsfRegime,
    psf_model,
)
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import TracedPsf, trace_psf
from camkit.models_def.optics.spot import slopes_for_heights
from camkit.units import UM_PER_MM

WAVE_LIGHT: Final = 0.996
_BLURS: Final = 2.0


def model_psf(
    lens: Lens,
    heights_mm: Tensor,
    wavelengths_um: Tensor,
    size_px: int,
    pitch_um: float,
    *,
    regime: PsfRegime,
    rays: int,
    light: float = WAVE_LIGHT,
) -> TracedPsf:
    """Return the PSF at sensor heights and wavelengths; arguments as of `psf.trace_psf`.

    A kernel whose own blur is `WAVE_BELOW` Airy radii or wider is traced by rays whatever the
    regime: waves would take minutes and change its MTF by less than 0.05.

    Args:
        lens: The prescription.
        heights_mm: (field,), on the sensor.
        wavelengths_um: (wavelength,).
        size_px: Odd kernel side.
        pitch_um: Sensor pitch.
        regime: Rays or waves.
        rays: In half the pupil, of what is traced by rays.
        light: Share of the light that waves are summed for: kernels are 0 beyond. The rings of
            an Airy pattern reach far: half as much light outside takes twice the window.
    """

    def by_rays(heights_mm: Tensor) -> TracedPsf:
        return trace_psf(lens, heights_mm, wavelengths_um, size_px, pitch_um, rays=rays)

    if regime == "rays":
        return by_rays(heights_mm)
    slopes = slopes_for_heights(lens, heights_mm)
    model = psf_model(lens, slopes, wavelengths_um)
    is_sharp = model.ratio < WAVE_BELOW
    if not bool(is_sharp.any()):
        return by_rays(heights_mm)
    side_px = min(size_px, _window_px(model, is_sharp, light, pitch_um))
    waves = wave_psf(lens, slopes, wavelengths_um, side_px, pitch_um, mask=is_sharp)
    kernels = tf.pad(waves.kernels, ((size_px - side_px) // 2,) * 4)
    energy = waves.energy_kept
    blurred = ~is_sharp.all(1)
    if bool(blurred.any()):
        traced = by_rays(heights_mm[blurred])
        mixed = is_sharp[blurred]
        shape = (..., None, None)
        kernels[blurred] = torch.where(mixed[shape], kernels[blurred], traced.kernels)
        energy[blurred] = torch.where(mixed, energy[blurred], traced.energy_kept)
    return TracedPsf(kernels=kernels, energy_kept=energy)


def _window_px(model: PsfModel, is_sharp: Tensor, light: float, pitch_um: float) -> int:
    """Return the odd side of a window that holds a share of an Airy pattern, blurred by the lens.

    Far from the middle J0^2 + J1^2, the light outside, is 2 / (pi v), v = pi r / (wavelength F).
    """
    unit_mm = float(model.airy_mm.max()) / AIRY
    blur_mm = float(model.blur_mm[is_sharp].max())
    reach_mm = 2 * unit_mm / (math.pi**2 * (1 - light)) + _BLURS * blur_mm
    return 2 * math.ceil(reach_mm * UM_PER_MM / pitch_um) + 1
