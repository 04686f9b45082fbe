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
from camkit.models_def.optics.analysis.wavefront import Wavefront
from camkit.models_def.optics.pupil import PupilSamples
from camkit.units import UM_PER_MM, to_mm

MAX_WAVE_RAYS: Final = 100_000
_CHUNK_RAYS: Final = 4096
_SPARE_RINGS: Final = 10
_SPARE_ARMS: Final = 16
_STEPS: Final = 8


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
    return disc_quadrature(*reach_rings(reach_mm, wavelength_um, aperture))


def reach_rings(
    reach_mm: float, wavelength_um: float, aperture: float, *, steps: bool = False
) -> tuple[int, int]:
    """Return the rings and arms of that sampling.

    Args:
        reach_mm: Half the diagonal of the window plus the largest ray error.
        wavelength_um: Of the light.
        aperture: Sine of the half cone, NA.
        steps: Round up in steps of a tenth, for rays that are interpolated; there may be twice as
            many of them.

    Raises:
        ContractError: If it would need more than `MAX_WAVE_RAYS` rays.
    """
    most = 2 * MAX_WAVE_RAYS if steps else MAX_WAVE_RAYS
    phase = 2 * math.pi / to_mm(wavelength_um) * aperture * reach_mm
    if steps:
        phase = 2 ** (math.ceil(_STEPS * math.log2(max(phase, 1))) / _STEPS)
    rings = math.ceil(phase / math.pi) + _SPARE_RINGS
    # a wave exp(i phase cos) has harmonics up to its phase and a few more
    arms = 2 * math.ceil((phase + 6 * phase ** (1 / 3)) / 2) + _SPARE_ARMS
    if rings * arms > most:
        raise ContractError(
            f"a wave PSF over {reach_mm * UM_PER_MM:.0f} um needs {rings * arms} rays, more than "
            f"{most}; a blur of that size is geometric: use the geometric PSF"
        )
    return rings, arms


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
