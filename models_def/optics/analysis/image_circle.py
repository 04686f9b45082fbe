"""The circle that a lens images, and the share of its stop that its rims leave open."""

import math
from typing import Final

import torch

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.spot import chief_heights, trace_spots
from camkit.models_def.optics.trace import Fate

_FIRST_STEP_DEG: Final = 4.0
_LAST_STEP_DEG: Final = 2e-4
_END_DEG: Final = 90.0
_RAYS: Final = 512


def image_radius_mm(lens: Lens) -> float:
    """Return the height on the sensor of the outermost chief ray that arrives.

    Field angles grow from the axis until a chief ray is lost, or lands nearer to the axis again.
    """
    angle_deg, step_deg, radius_mm = 0.0, _FIRST_STEP_DEG, 0.0
    while step_deg > _LAST_STEP_DEG:
        ahead_mm = _height_mm(lens, angle_deg + step_deg)
        if ahead_mm > radius_mm:
            angle_deg, radius_mm = angle_deg + step_deg, ahead_mm
        else:
            step_deg /= 2
    return radius_mm


def _height_mm(lens: Lens, angle_deg: float) -> float:
    """Return the height of a chief ray; -inf of one that is lost."""
    if angle_deg >= _END_DEG:
        return -math.inf
    slope = math.tan(math.radians(angle_deg))
    with torch.no_grad():
        try:
            return float(chief_heights(lens, torch.tensor([slope], dtype=torch.float64))[0])
        except ContractError:
            return -math.inf


def open_share(lens: Lens) -> float:
    """Return the share of the stop, at its stated size, that light of an axial point fills.

    Below 1 where rims are narrower than the beam.
    """
    axis = torch.zeros(1, dtype=torch.float64)
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    with torch.no_grad():
        fate = trace_spots(lens, axis, wave, half_disc(_RAYS)).fate
    return float((fate == Fate.VALID).double().mean())
