"""The PSF of a lens by rays or by waves, at heights on the sensor."""

import math
from typing import Final

import torch
import torch.nn.functional as tf
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.first_order import AIRY, airy_radius_mm
from camkit.models_def.optics.analysis.lens_waves import wave_psf
from camkit.models_def.optics.analysis.psf_model import PsfRegime, psf_model
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import TracedPsf, trace_psf
from camkit.models_def.optics.spot import slopes_for_heights
from camkit.units import UM_PER_MM

RAYS_FROM: Final = 25.0
"""RMS blur over Airy radius from which a field of a lens that takes waves is traced by rays."""
_BLURS: Final = 3.0
_WIDEST_PX: Final = 4097


def model_psf(
    lens: Lens,
    heights_mm: Tensor,
    wavelengths_um: Tensor,
    size_px: int,
    pitch_um: float,
    *,
    regime: PsfRegime,
    rays: int,
    light: float = 1.0,
) -> TracedPsf:
    """Return the PSF at sensor heights and wavelengths; arguments as of `psf.trace_psf`.

    Fields whose blur is `RAYS_FROM` Airy radii or wider are traced by rays whatever the regime: the
    MTF of both differs by 0.02 there, and waves would take minutes.

    Args:
        lens: The prescription.
        heights_mm: (field,), on the sensor.
        wavelengths_um: (wavelength,).
        size_px: Odd kernel side.
        pitch_um: Sensor pitch.
        regime: Rays or waves.
        rays: In half the pupil, of a field by rays.
        light: Share of the light that waves are summed for: kernels are 0 beyond. The rings of
            an Airy pattern reach far: half as much light outside takes twice the window.
    """
    if regime == "rays":
        return trace_psf(lens, heights_mm, wavelengths_um, size_px, pitch_um, rays=rays)
    slopes = slopes_for_heights(lens, heights_mm)
    white = torch.full((1, len(wavelengths_um)), 1 / len(wavelengths_um), dtype=torch.float64)
    model = psf_model(lens, slopes, wavelengths_um, white)
    is_sharp = model.ratio[:, 0] < RAYS_FROM
    shape = len(heights_mm), len(wavelengths_um), size_px, size_px
    kernels = torch.zeros(shape, dtype=torch.float64)
    energy = kernels.new_zeros(shape[:2])
    if bool(is_sharp.any()):
        blur_mm = float(model.blur_mm[is_sharp].max())
        needed_px = _window_px(lens, float(wavelengths_um.max()), blur_mm, light, pitch_um)
        side_px = min(size_px, needed_px)
        psf = wave_psf(lens, slopes[is_sharp], wavelengths_um, side_px, pitch_um)
        border = (size_px - side_px) // 2
        kernels[is_sharp] = tf.pad(psf.kernels, (border,) * 4)
        energy[is_sharp] = psf.energy_kept
    if not bool(is_sharp.all()):
        psf = trace_psf(lens, heights_mm[~is_sharp], wavelengths_um, size_px, pitch_um, rays=rays)
        kernels[~is_sharp], energy[~is_sharp] = psf.kernels, psf.energy_kept
    return TracedPsf(kernels=kernels, energy_kept=energy)


def _window_px(
    lens: Lens, wavelength_um: float, blur_mm: float, light: float, pitch_um: float
) -> int:
    """Return the odd side of a window that holds a share of an Airy pattern, blurred by the lens.

    Far from the middle J0^2 + J1^2, the light outside, is 2 / (pi v), v = pi r / (wavelength F).
    """
    if light >= 1:
        return _WIDEST_PX
    unit_mm = airy_radius_mm(lens, wavelength_um) / AIRY
    if not math.isfinite(unit_mm):
        raise ContractError("waves need a lens that forms an image; use rays")
    reach_mm = 2 * unit_mm / (math.pi**2 * (1 - light)) + _BLURS * blur_mm
    return min(2 * math.ceil(reach_mm * UM_PER_MM / pitch_um) + 1, _WIDEST_PX)
