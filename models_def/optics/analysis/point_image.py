"""The image of a point by diffraction, field by field: its light, Strehl ratio, encircled energy.

Every field has a window of its own: as wide as its blur and a few Airy radii, sampled a little
finer than the light can vary.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.first_order import AIRY
from camkit.models_def.optics.analysis.sampling import rim_samples
from camkit.models_def.optics.analysis.wave_psf import (
    irradiance_per_mm2,
    pupil_for_reach,
    widest_aperture,
)
from camkit.models_def.optics.analysis.wavefront import Wavefront, trace_wavefront
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import PupilDefinition
from camkit.models_def.optics.spot import Spots
from camkit.units import UM_PER_MM

_WINDOW_AIRY: Final = 6.0
_SAMPLES_PER_CUTOFF: Final = 2.2
_MOST_WORK: Final = 1.5e9
"""Samples times rays of one field and wavelength; half a second to two."""
_PEAK_ROUNDS: Final = 3
_PEAK_SIDE: Final = 9
_NO_FREQUENCY: Final = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class PointImage:
    """The light of one field about the chief ray of the reference wavelength.

    Attributes:
        light_per_mm2: (wavelength, y, x), of 1 that passes the lens.
        x_mm: (x,), places of the samples, one distance apart.
        y_mm: (y,), the same, away from the axis; both reach a few Airy radii beyond the rays.
        strehl: (wavelength,), peak over that of the same pupil without aberration.
    """

    light_per_mm2: Tensor
    x_mm: Tensor
    y_mm: Tensor
    strehl: Tensor

    @property
    def pitch_mm(self) -> float:
        """The distance of the samples in both directions."""
        return float(self.x_mm[1] - self.x_mm[0])


def trace_point_image(
    lens: Lens,
    slope: Tensor,
    wavelengths_um: Tensor,
    spots: Spots,
    definition: PupilDefinition = "stop",
) -> PointImage:
    """Sum the diffraction image of a field.

    Args:
        lens: The prescription.
        slope: (1,), tan of the field angle.
        wavelengths_um: (wavelength,).
        spots: Rays of the field alone; they say how wide the window must be.
        definition: Of the pupil.

    Raises:
        ContractError: If no ray arrives, or the blur is so wide that waves take too long.
    """
    rim = trace_wavefront(lens, slope, wavelengths_um, rim_samples(), definition)
    if not bool((rim.flux > 0).any(-1).all()):
        raise ContractError("no ray reaches the sensor")
    aperture = widest_aperture(rim)
    if not aperture:
        raise ContractError("the light makes no cone: the lens has no focus")
    shortest, longest = float(wavelengths_um.min()), float(wavelengths_um.max())
    margin = _WINDOW_AIRY * AIRY * longest / UM_PER_MM / (2 * aperture)
    pitch_mm = shortest / UM_PER_MM / (2 * aperture) / _SAMPLES_PER_CUTOFF
    alive = spots.weight > 0
    x_mm = _places(spots.x_mm[alive], margin, pitch_mm)
    y_mm = _places(spots.y_mm[alive] - float(spots.chief_y_mm[0]), margin, pitch_mm)
    reach_mm = math.hypot(float(x_mm[-1] - x_mm[0]), float(y_mm[-1] - y_mm[0])) / 2
    samples = pupil_for_reach(reach_mm, shortest, aperture)
    if len(x_mm) * len(y_mm) * len(samples.x) > _MOST_WORK:
        raise ContractError(
            f"a blur of {2 * reach_mm * UM_PER_MM:.3g} um is too wide for waves: rays describe it"
        )
    wavefront = trace_wavefront(lens, slope, wavelengths_um, samples, definition)
    light = irradiance_per_mm2(wavefront, x_mm, y_mm)[0]
    return PointImage(
        light_per_mm2=light, x_mm=x_mm, y_mm=y_mm, strehl=_strehl(wavefront, light, x_mm, y_mm)
    )


def _places(landings_mm: Tensor, margin_mm: float, pitch_mm: float) -> Tensor:
    """Return evenly spaced places from a margin below all landings to one above."""
    low, high = float(landings_mm.min()) - margin_mm, float(landings_mm.max()) + margin_mm
    count = math.ceil((high - low) / pitch_mm)
    return (low + high) / 2 + (torch.arange(count + 1, dtype=torch.float64) - count / 2) * pitch_mm


def _strehl(wavefront: Wavefront, light: Tensor, x_mm: Tensor, y_mm: Tensor) -> Tensor:
    """Return the Strehl ratios (wavelength,); the peak is looked for between the samples."""
    zero = torch.zeros(1, dtype=torch.float64)
    ratios = []
    for j, image in enumerate(light):
        one = _part(wavefront, j)
        row, column = divmod(int(image.argmax()), image.shape[-1])
        x, y, step = x_mm[column], y_mm[row], float(x_mm[1] - x_mm[0])
        for _ in range(_PEAK_ROUNDS):
            near = torch.linspace(-step, step, _PEAK_SIDE, dtype=torch.float64)
            zoomed = irradiance_per_mm2(one, x + near, y + near)[0, 0]
            row, column = divmod(int(zoomed.argmax()), _PEAK_SIDE)
            x, y, step = x + near[column], y + near[row], step / (_PEAK_SIDE // 2)
        perfect = irradiance_per_mm2(replace(one, opd_um=0 * one.opd_um), zero, zero)
        ratios.append(zoomed.max() / perfect[0, 0, 0, 0])
    return torch.stack(ratios)


def _part(wavefront: Wavefront, wavelength: int) -> Wavefront:
    """Return one wavelength of a wavefront."""
    here = slice(wavelength, wavelength + 1)
    cut: dict[str, Any] = {
        field.name: getattr(wavefront, field.name)[:, here]
        for field in fields(wavefront)
        if field.name not in ("wavelengths_um", "centre_mm")
    }
    return replace(wavefront, wavelengths_um=wavefront.wavelengths_um[here], **cut)


def encircled_energy(image: PointImage, radii_mm: Tensor) -> Tensor:
    """Return the share of the light (radius,) within circles about the centroid.

    All wavelengths count equally. The light is summed from its spatial frequencies, each of which
    has a closed form over a disc: r J1(2 pi f r) / f. NaN where a circle leaves the window.

    Args:
        image: Of a field.
        radii_mm: (radius,).
    """
    light = image.light_per_mm2.mean(0)
    share = light / light.sum()
    x, y = (share.sum(0) * image.x_mm).sum(), (share.sum(1) * image.y_mm).sum()
    frequency_x, frequency_y = (
        torch.fft.fftfreq(len(places), image.pitch_mm, dtype=torch.float64)
        for places in (image.x_mm, image.y_mm)
    )
    # the first sample lies at the first place, the circle about (x, y)
    shift_x = torch.exp(2j * math.pi * frequency_x * (x - image.x_mm[0]))
    shift_y = torch.exp(2j * math.pi * frequency_y * (y - image.y_mm[0]))
    waves = (torch.fft.fft2(light) * shift_y[:, None] * shift_x).real.flatten() / light.numel()
    length = torch.hypot(frequency_y[:, None], frequency_x).flatten().clamp_min(_NO_FREQUENCY)
    shares = [
        (waves * radius * torch.special.bessel_j1(2 * math.pi * length * radius) / length).sum()
        for radius in radii_mm
    ]
    room = torch.stack(
        [x - image.x_mm[0], image.x_mm[-1] - x, y - image.y_mm[0], image.y_mm[-1] - y]
    )
    return torch.where(radii_mm <= room.min(), torch.stack(shares), math.nan)


def encircled_rays(spots: Spots, field: int, radii_mm: Tensor) -> Tensor:
    """Return the share of the rays (radius,) within circles about the centroid; NaN without rays.

    Args:
        spots: Rays on the sensor; all wavelengths count equally.
        field: Number of the field.
        radii_mm: (radius,).
    """
    weight = spots.weight[field] / spots.weight[field].sum(-1, keepdim=True)
    weight = weight / len(weight)
    x, y = spots.x_mm[field], spots.y_mm[field]
    distance = torch.hypot(x - (weight * x).sum(), y - (weight * y).sum())
    inside = torch.where(distance[..., None] <= radii_mm, weight[..., None], 0.0).sum((0, 1))
    return torch.where(torch.isfinite(weight).all(), inside, math.nan)


def encircled_airy(radii_mm: Tensor, airy_mm: Tensor) -> Tensor:
    """Return what a perfect lens has (radius,), mean over wavelengths: 1 - J0^2 - J1^2.

    Args:
        radii_mm: (radius,).
        airy_mm: (wavelength,), radii of the first dark ring.

    References: Born and Wolf, Principles of Optics, section 8.5.2 (Rayleigh 1881).
    """
    v = math.pi * AIRY * radii_mm / airy_mm[:, None]
    outside: Tensor = torch.special.bessel_j0(v) ** 2 + torch.special.bessel_j1(v) ** 2
    return 1 - outside.mean(0)


def radius_of_share(radii_mm: Tensor, shares: Tensor, share: float) -> float:
    """Return the radius in mm at which a curve of encircled energy reaches a share; NaN if never.

    Args:
        radii_mm: (radius,), increasing.
        shares: (radius,).
        share: Of the light, 0..1.
    """
    is_reached = torch.nan_to_num(shares, nan=-1.0) >= share
    if not bool(is_reached.any()):
        return math.nan
    last = int(is_reached.double().argmax())
    if not last:
        return float(radii_mm[0])
    low, high = float(shares[last - 1]), float(shares[last])
    part = (share - low) / (high - low)
    return float(radii_mm[last - 1] + part * (radii_mm[last] - radii_mm[last - 1]))
