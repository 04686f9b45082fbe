"""The circle that a lens images, and the share of its stop that its rims leave open."""

from typing import Final

import numpy as np
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.chief_path import chief_path
from camkit.models_def.optics.aiming.field import slope_of
from camkit.models_def.optics.configuration.field_limits import TANGENT_DEG
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.spot import chief_heights, trace_spots
from camkit.models_def.optics.trace import Fate
from camkit.units import to_radians

_HALVINGS: Final = 16
_RAYS: Final = 512


def image_radius_mm(lens: Lens) -> float:
    """Return the height on the sensor of the outermost field from which light arrives.

    Fields are those of `chief_path`, up to where chief rays land nearer to the axis again, and to
    89.5 degrees, where cameras end (their distortion is by tangents); which is the outermost one
    that the rims leave some light is found by halving.
    """
    path = chief_path(lens)
    low, high = 0.0, min(float(path.angles_rad[path.outermost]), to_radians(TANGENT_DEG))
    if _is_lit(lens, high):
        return float(np.interp(high, path.angles_rad, np.abs(path.heights_mm)))
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if _is_lit(lens, middle) else (low, middle)
    return abs(float(chief_heights(lens, torch.tensor([slope_of(low)], dtype=torch.float64))[0]))


def _is_lit(lens: Lens, angle_rad: float) -> bool:
    """Return whether the rims let a ray of a field through."""
    return bool((_fates(lens, angle_rad) == Fate.VALID).any())


def open_share(lens: Lens) -> float:
    """Return the share of the stop, at its stated size, that light of an axial point fills.

    Below 1 where rims are narrower than the beam.
    """
    return float((_fates(lens, 0.0) == Fate.VALID).double().mean())


def _fates(lens: Lens, angle_rad: float) -> torch.Tensor:
    """Return what became of the rays that fill the stop from a field; all lost without a chief."""
    slope = torch.tensor([slope_of(angle_rad)], dtype=torch.float64)
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    with torch.no_grad():
        try:
            return trace_spots(lens, slope, wave, half_disc(_RAYS)).fate
        except ContractError:
            return torch.full((1,), int(Fate.MISSED))
