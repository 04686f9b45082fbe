"""Contrast against spatial frequency.

Tangential is the contrast of lines across the meridian (along y of the PSF), sagittal that of
lines along it. Light of several wavelengths is added before the contrast is taken, each counting
once.
"""

import math
from dataclasses import dataclass
from typing import Final

import scipy.special
import torch
from torch import Tensor

from camkit.models_def.optics.analysis.wavefront import Wavefront
from camkit.models_def.optics.spot import Spots
from camkit.units import UM_PER_MM

_ROUND_WINDOW: Final = math.pi / 4 / math.sqrt(2)
"""Radius of the disc outside which as much of the far rings lies as outside a square of side 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mtf:
    """Contrast at frequencies in cycles/mm.

    Attributes:
        tangential: (field, frequency).
        sagittal: (field, frequency).
    """

    tangential: Tensor
    sagittal: Tensor

    def times(self, other: "Mtf") -> "Mtf":
        """Return the product."""
        return Mtf(
            tangential=self.tangential * other.tangential, sagittal=self.sagittal * other.sagittal
        )


def diffraction_mtf(share: Tensor) -> Tensor:
    """Return the contrast of a perfect round pupil at shares of its cutoff frequency.

    References: Goodman, Introduction to Fourier Optics, eq. (6-32) in the 3rd edition:
        2/pi (acos s - s sqrt(1 - s^2)).
    """
    s = torch.abs(share).clamp_max(1.0)
    return 2 / math.pi * (torch.acos(s) - s * torch.sqrt(1 - s**2))


def diffraction_limit(wavefront: Wavefront, cycles_per_mm: Tensor) -> Mtf:
    """Return the contrast of the same pupil without aberration, an ellipse of its extents.

    Off the axis the pupil is seen foreshortened: the extents in m and l set the cutoff of
    tangential and sagittal lines, extent / wavelength. A vignetted pupil is no ellipse: for it
    this is an estimate.

    Args:
        wavefront: With rays at the rim of the pupil.
        cycles_per_mm: (frequency,).
    """
    alive = wavefront.flux > 0

    def contrast(cosine: Tensor) -> Tensor:
        width = torch.where(alive, cosine, -math.inf).amax(-1)
        width = width - torch.where(alive, cosine, math.inf).amin(-1)
        cutoff = width.clamp_min(1e-12) * UM_PER_MM / wavefront.wavelengths_um
        return diffraction_mtf(cycles_per_mm / cutoff[..., None]).mean(1)

    return Mtf(tangential=contrast(wavefront.m), sagittal=contrast(wavefront.l))


def geometric_mtf(spots: Spots, cycles_per_mm: Tensor) -> Mtf:
    """Return the contrast of rays alone: the Fourier transform of the spots; no pixel is involved.

    NaN for a field without rays. `times` the diffraction limit it estimates the contrast of a
    lens between both models.
    """

    def contrast(place_mm: Tensor) -> Tensor:
        turns = -2 * math.pi * cycles_per_mm[:, None] * place_mm[:, :, None, :]
        waves = torch.polar(spots.weight[:, :, None, :].expand_as(turns), turns).sum(-1)
        return torch.abs(waves.sum(1)) / spots.weight.sum((1, 2))[:, None]

    middle = spots.chief_y_mm[:, None, None]
    return Mtf(tangential=contrast(spots.y_mm - middle), sagittal=contrast(spots.x_mm))


def mtf_of_psf(
    psf: Tensor, pitch_um: float, cycles_per_mm: Tensor, energy: Tensor | None = None
) -> Mtf:
    """Return the contrast of pictures of points; 1 at frequency 0.

    Args:
        psf: (field, wavelength, y, x), on one common centre; any scale.
        pitch_um: Distance of its samples.
        cycles_per_mm: (frequency,), up to half a cycle per sample.
        energy: (field, wavelength), the light of the whole plane in units of the sum of `psf`,
            which is all by default. Light outside the window is taken for the far rings of
            diffraction, which fall as the distance to the power of -3.
    """
    whole = psf.sum((-2, -1)) if energy is None else energy
    light = (psf / whole[..., None, None]).mean(1)
    side = math.sqrt(light.shape[-1] * light.shape[-2]) * pitch_um / UM_PER_MM
    outer = _far_rings(2 * math.pi * cycles_per_mm * side * _ROUND_WINDOW)
    missing = (1 - light.sum((-2, -1))).clamp_min(0.0)[:, None] * outer

    def contrast(line: Tensor) -> Tensor:
        count = line.shape[-1]
        place_mm = (torch.arange(count, dtype=line.dtype) - (count - 1) / 2) * pitch_um / UM_PER_MM
        turns = -2 * math.pi * cycles_per_mm[:, None] * place_mm
        waves = torch.polar(torch.ones_like(turns), turns) * line[:, None]
        return torch.abs(waves.sum(-1) + missing)

    return Mtf(tangential=contrast(light.sum(-1)), sagittal=contrast(light.sum(-2)))


def _far_rings(turn: Tensor) -> Tensor:
    """Return the Hankel transform of light that falls as r^-3 from a radius R on, and is 1 in all.

    The integral of J0(turn s) / s^2 from 1 on, by parts: J0 - turn (1 + J1 - integral of J0).

    Args:
        turn: 2 pi f R.
    """
    whole = torch.from_numpy(scipy.special.itj0y0(turn.numpy())[0])
    bessel_0, bessel_1 = torch.special.bessel_j0(turn), torch.special.bessel_j1(turn)
    rings: Tensor = bessel_0 - turn * (1 + bessel_1 - whole)
    return rings
