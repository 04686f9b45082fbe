"""Landing points of rays on the sensor: chief rays, field slopes for sensor heights, spots."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.chief_path import chief_path
from camkit.models_def.optics.aiming.field import STEEPEST, field_angle, field_slope, is_steep
from camkit.models_def.optics.aiming.start import with_open_apertures
from camkit.models_def.optics.configuration.field_limits import TANGENT_DEG
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import PupilDefinition, PupilSamples, pupil_centre, pupil_rays
from camkit.models_def.optics.trace import surface_tensors, trace
from camkit.units import to_degrees

_SLOPE_STEPS: Final = 12
_SLOPE_TOLERANCE_MM: Final = 1e-9
_SLOPE_DIFFERENCE: Final = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Spots:
    """Rays on the sensor.

    Attributes:
        x_mm: (field, wavelength, rays), 0 is the meridional plane.
        y_mm: (field, wavelength, rays), on the sensor; the image of a field lies at +y.
        weight: (field, wavelength, rays), 0 for rays that were lost.
        chief_y_mm: (field,), chief ray of the reference wavelength.
        fate: (field, wavelength, rays) int8, see `trace.Fate`.
    """

    x_mm: Tensor
    y_mm: Tensor
    weight: Tensor
    chief_y_mm: Tensor
    fate: Tensor


def chief_heights(lens: Lens, slopes: Tensor, wavelength_um: float | None = None) -> Tensor:
    """Return the heights (field,) in mm at which chief rays of field slopes meet the sensor.

    The chief ray passes the centre of the stop; it is a reference, which no rim and no wall of a
    groove takes.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
        wavelength_um: The reference wavelength by default.

    Raises:
        ContractError: If a chief ray is lost.
    """
    wave = lens.reference_wavelength_um if wavelength_um is None else wavelength_um
    tensors = surface_tensors(lens, torch.tensor(wave, dtype=torch.float64))
    tensors = with_open_apertures(tensors)
    rays, _ = pupil_rays(lens, tensors, pupil_centre(), slopes[:, None])
    landings = trace(tensors, rays)
    if not bool(landings.valid.all()):
        lost_slopes = torch.rad2deg(field_angle(slopes[~landings.valid[:, 0]])).tolist()
        angles = ", ".join(dict.fromkeys(f"{angle:.1f}" for angle in lost_slopes))
        raise ContractError(
            f"the chief ray is lost at {angles} degrees: {lens.name} is aimed to "
            f"{chief_path(lens).reach}; use smaller fields or a smaller sensor"
        )
    return landings.y[:, 0]


def slopes_for_heights(lens: Lens, heights_mm: Tensor) -> Tensor:
    """Find the field slopes (field,) whose reference chief ray lands at given heights.

    Newton's method without gradient: from the paraxial slopes, and where that fails from the chief
    rays that were followed out from the axis (`chief_path`).

    Raises:
        ContractError: If a height cannot be reached; it names the height that can.
    """
    heights_mm = heights_mm.to(torch.float64)
    with torch.no_grad():
        try:
            step = torch.full((1,), _SLOPE_DIFFERENCE, dtype=torch.float64)
            scale = chief_heights(lens, step)[0] / _SLOPE_DIFFERENCE
            slopes = _corrected_slopes(lens, heights_mm, heights_mm / scale)
        except ContractError:
            slopes = None
        if slopes is None:
            begin = _followed_slopes(lens, heights_mm)
            slopes = _corrected_slopes(lens, heights_mm, begin, math.inf)
    if slopes is None:
        raise ContractError(f"no field reaches the sensor heights {heights_mm.tolist()} mm")
    return slopes


def tangents_for_heights(lens: Lens, heights_mm: Tensor, what: str) -> Tensor:
    """Return tan of the field angles (field,) whose reference chief ray lands at given heights.

    Args:
        lens: The prescription.
        heights_mm: (field,).
        what: What needs the tangent, for the message.

    Raises:
        ContractError: If a height cannot be reached, or not below 89.5 degrees.
    """
    slopes = slopes_for_heights(lens, heights_mm)
    if bool(is_steep(slopes).any()):
        widest_deg = to_degrees(float(field_angle(slopes).abs().max()))
        edge_mm = abs(float(chief_heights(lens, slopes.new_tensor([STEEPEST]))[0]))
        raise ContractError(
            f"{what} carries fields as tangents, to {TANGENT_DEG} degrees = {edge_mm:.2f} mm; the "
            f"sensor's corner is at {widest_deg:.1f} degrees: use a smaller sensor"
        )
    return slopes


def _corrected_slopes(
    lens: Lens, heights_mm: Tensor, slopes: Tensor, steepest: float = STEEPEST
) -> Tensor | None:
    """Return slopes that land at the heights by Newton's method; None if that does not settle."""
    for _ in range(_SLOPE_STEPS):
        both = chief_heights(lens, torch.cat([slopes, slopes + _SLOPE_DIFFERENCE]))
        here, ahead = both.chunk(2)
        missed_by = heights_mm - here
        if bool((torch.abs(missed_by) < _SLOPE_TOLERANCE_MM).all()):
            # what Newton finds at grazing angles is no field of the lens
            return slopes if bool((slopes.abs() < steepest).all()) else None
        slopes = slopes + missed_by * _SLOPE_DIFFERENCE / (ahead - here)
    return None


def _followed_slopes(lens: Lens, heights_mm: Tensor) -> Tensor:
    """Return slopes near those of the heights, from the chief rays that `chief_path` found."""
    path = chief_path(lens)
    rising = slice(path.outermost + 1)
    reached_mm = np.abs(path.heights_mm[rising])
    wanted_mm = float(heights_mm.abs().max())
    if wanted_mm > reached_mm[-1]:
        raise ContractError(
            f"{lens.name} is aimed to {path.reach}; the sensor's corner is at {wanted_mm:.2f} mm: "
            "use a smaller sensor"
        )
    angles = np.interp(np.abs(heights_mm.numpy()), reached_mm, path.angles_rad[rising])
    side = float(np.sign(path.heights_mm[path.outermost]))
    return side * field_slope(torch.from_numpy(angles)) * torch.sign(heights_mm)


def trace_spots(
    lens: Lens,
    slopes: Tensor,
    wavelengths_um: Tensor,
    samples: PupilSamples,
    *,
    definition: PupilDefinition = "stop",
) -> Spots:
    """Trace the pupil at every field and wavelength.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
        wavelengths_um: (wavelength,).
        samples: Of the unit disc, (rays,).
        definition: See `pupil`.
    """
    tensors = surface_tensors(lens, wavelengths_um[:, None])
    slope = slopes[:, None, None].expand(-1, len(wavelengths_um), 1)
    rays, weight = pupil_rays(lens, tensors, samples, slope, definition=definition)
    landings = trace(tensors, rays)
    return Spots(
        x_mm=landings.x,
        y_mm=landings.y,
        weight=torch.where(landings.valid, weight, 0.0),
        chief_y_mm=chief_heights(lens, slopes),
        fate=landings.fate,
    )


def rms_radius(spots: Spots) -> Tensor:
    """Return the RMS spot radius (field, wavelength) in mm about the centroid."""
    total = spots.weight.sum(-1, keepdim=True).clamp_min(1e-12)
    share = spots.weight / total
    dx = spots.x_mm - (share * spots.x_mm).sum(-1, keepdim=True)
    dy = spots.y_mm - (share * spots.y_mm).sum(-1, keepdim=True)
    return torch.sqrt((share * (dx**2 + dy**2)).sum(-1))


def all_waves(spots: Spots) -> Spots:
    """Return the spots of all wavelengths as one, (field, 1, wavelength * rays), waves alike."""
    total = spots.weight.sum(-1, keepdim=True).clamp_min(1e-12)
    return replace(
        spots,
        x_mm=spots.x_mm.flatten(1)[:, None],
        y_mm=spots.y_mm.flatten(1)[:, None],
        weight=(spots.weight / total).flatten(1)[:, None],
        fate=spots.fate.flatten(1)[:, None],
    )
