"""The PSF by diffraction: a sum of the plane waves that leave the exit pupil.

Each ray stands for one plane wave, whose direction is that from the reference sphere towards its
centre and whose phase is its OPD (Debye's approximation; scalar, so good to about F/1.4):

    U(x, y) = sum_j a_j exp(2 pi i / wavelength (l_j x + m_j y - OPD_j))

The rays lie where the pupil was sampled, so the sum is a matrix product per field and wavelength
(a Fourier transform onto any pixel grid), with no interpolation and no padding.
"""

import math
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.sampling import disc_quadrature
from camkit.models_def.optics.analysis.wavefront import Wavefront, trace_wavefront
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import TracedPsf
from camkit.models_def.optics.pupil import PupilDefinition, PupilSamples
from camkit.units import UM_PER_MM, to_mm

MAX_WAVE_RAYS: Final = 100_000
_CHUNK_RAYS: Final = 4096
_SPARE_RINGS: Final = 10
_SPARE_ARMS: Final = 16


def irradiance_per_mm2(wavefront: Wavefront, x_mm: Tensor, y_mm: Tensor) -> Tensor:
    """Return the light on a grid of points about the centre, of 1 that passes the lens.

    Args:
        wavefront: (field, wavelength, rays), sampled finely enough, see `pupil_for_reach`.
        x_mm: (x,), sagittal.
        y_mm: (y,), away from the axis.

    Returns:
        (field, wavelength, y, x) in 1/mm^2; its integral over the plane is 1.
    """
    fields, waves = wavefront.opd_um.shape[:2]
    rows = [
        torch.stack([_one(wavefront, i, j, x_mm, y_mm) for j in range(waves)])
        for i in range(fields)
    ]
    return torch.stack(rows)


def _one(wavefront: Wavefront, i: int, j: int, x_mm: Tensor, y_mm: Tensor) -> Tensor:
    wave_um = wavefront.wavelengths_um[j]
    turn = 2 * math.pi / wave_um
    amplitude = torch.polar(wavefront.amplitude[i, j], -turn * wavefront.opd_um[i, j])
    field = torch.zeros(len(y_mm), len(x_mm), dtype=amplitude.dtype)
    for part in torch.split(torch.arange(len(amplitude)), _CHUNK_RAYS):
        down = turn * UM_PER_MM * wavefront.m[i, j, part] * y_mm[:, None]
        right = turn * UM_PER_MM * wavefront.l[i, j, part, None] * x_mm
        waves = torch.polar(torch.ones_like(down), down) * amplitude[part]
        field = field + waves @ torch.polar(torch.ones_like(right), right)
    # Parseval: the integral of |U|^2 is wavelength^2 times the energy of all rays
    energy = (wave_um / UM_PER_MM) ** 2 * wavefront.flux[i, j].sum()
    return (field.real**2 + field.imag**2) / energy


def pupil_for_reach(reach_mm: float, wavelength_um: float, aperture: float) -> PupilSamples:
    """Return a pupil sampling fine enough for light up to a distance from the centre.

    Args:
        reach_mm: Half the diagonal of the window plus the largest ray error.
        wavelength_um: The shortest.
        aperture: Sine of the half cone, NA.

    Raises:
        ContractError: If it would need more than `MAX_WAVE_RAYS` rays.
    """
    phase = 2 * math.pi / to_mm(wavelength_um) * aperture * reach_mm
    rings = math.ceil(phase / math.pi) + _SPARE_RINGS
    # a wave exp(i phase cos) has harmonics up to its phase and a few more
    arms = 2 * math.ceil((phase + 6 * phase ** (1 / 3)) / 2) + _SPARE_ARMS
    if rings * arms > MAX_WAVE_RAYS:
        raise ContractError(
            f"a wave PSF over {reach_mm * UM_PER_MM:.0f} um needs {rings * arms} rays, more than "
            f"{MAX_WAVE_RAYS}; a blur of that size is geometric: use the geometric PSF"
        )
    return disc_quadrature(rings, arms)


def wave_kernels(wavefront: Wavefront, size_px: int, pitch_um: float, oversample: int) -> TracedPsf:
    """Return kernels (field, wavelength, size, size) as `psf.splat` does: pixels are tents.

    Args:
        wavefront: Sampled for the window.
        size_px: Odd kernel side.
        pitch_um: Sensor pitch.
        oversample: Odd; points per pixel and axis.

    Raises:
        ContractError: If a number is even.
    """
    if size_px < 1 or size_px % 2 == 0 or oversample < 1 or oversample % 2 == 0:
        raise ContractError(
            f"kernel side and oversampling must be odd; got {size_px} and {oversample}"
        )
    count = (size_px + 1) * oversample
    place_px = (torch.arange(count, dtype=torch.float64) - (count - 1) / 2) / oversample
    place_mm = place_px * pitch_um / UM_PER_MM
    light = irradiance_per_mm2(wavefront, place_mm, place_mm)
    tent = _tent_weights(place_px, size_px, oversample) * pitch_um / UM_PER_MM
    kernels = tent @ light @ tent.T
    energy = kernels.sum((-2, -1))
    return TracedPsf(kernels=kernels / energy[..., None, None], energy_kept=energy)


def _tent_weights(place_px: Tensor, size_px: int, oversample: int) -> Tensor:
    """Return weights (pixel, point) that integrate over the tents of pixels.

    The midpoint rule with its first correction (Euler and Maclaurin): what it lacks comes from
    the kinks of the tent, which lie between points.
    """
    pixel = torch.arange(size_px, dtype=torch.float64) - (size_px - 1) / 2
    distance_px = torch.abs(place_px - pixel[:, None])
    half = 0.5 / oversample
    top, foot = (torch.abs(distance_px - place) < 1.5 * half for place in (0.0, 1.0))
    kinks = (2 * top.to(torch.float64) - foot.to(torch.float64)) / (48 * oversample**2)
    return (1 - distance_px).clamp_min(0.0) / oversample + kinks


def trace_wave_psf(
    lens: Lens,
    slopes: Tensor,
    wavelengths_um: Tensor,
    size_px: int,
    pitch_um: float,
    *,
    definition: PupilDefinition = "stop",
) -> TracedPsf:
    """Trace the wave PSF of fields; see `psf.trace_psf` for the kernels.

    Raises:
        ContractError: If the blur is too wide for it (see `pupil_for_reach`).
    """
    coarse = trace_wavefront(lens, slopes, wavelengths_um, disc_quadrature(6, 16), definition)
    aperture = widest_aperture(coarse)
    shortest = float(wavelengths_um.min())
    reach = math.sqrt(0.5) * (size_px + 1) * pitch_um / UM_PER_MM + float(coarse.miss_mm.max())
    samples = pupil_for_reach(reach, shortest, aperture)
    fine_um = shortest / (6 * aperture)
    oversample = 2 * math.ceil((pitch_um / fine_um - 1) / 2) + 1
    wavefront = trace_wavefront(lens, slopes, wavelengths_um, samples, definition)
    return wave_kernels(wavefront, size_px, pitch_um, max(1, oversample))


def widest_aperture(wavefront: Wavefront) -> float:
    """Return half the widest extent of the pupil in direction cosines, the NA of its cone.

    Raises:
        ContractError: If no ray arrives at a field.
    """
    alive = wavefront.amplitude > 0
    if not bool(alive.any(-1).all()):
        raise ContractError("no ray arrives at a field; check stop, semi-diameters and fields")
    widths = [
        torch.where(alive, c, -math.inf).amax(-1) - torch.where(alive, c, math.inf).amin(-1)
        for c in (wavefront.l, wavefront.m)
    ]
    return float(torch.stack(widths).max()) / 2
