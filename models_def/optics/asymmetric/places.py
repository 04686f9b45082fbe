"""The field whose chief ray lands at a place of the sensor, for any lens."""

import functools
import math
from dataclasses import dataclass
from typing import Final

import torch

from camkit.errors import ContractError
from camkit.models_def.optics.asymmetric.turning import round_part, turned_back, turned_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import pupil_centre, pupil_rays
from camkit.models_def.optics.spot import tangents_for_heights
from camkit.models_def.optics.trace import surface_tensors, trace

_STEPS: Final = 12
_TOLERANCE_MM: Final = 1e-7
_DIFFERENCE: Final = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """A direction into the scene.

    Attributes:
        azimuth_rad: Of its image, from +y towards +x.
        slope: tan of the field angle.
    """

    azimuth_rad: float
    slope: float


@functools.lru_cache(maxsize=64)
def fields_of_places(lens: Lens, places_mm: tuple[tuple[float, float], ...]) -> tuple[Field, ...]:
    """Return the fields whose reference chief rays land at places, by Newton's method.

    Raises:
        ContractError: If no field reaches one.
    """
    heights = torch.tensor([math.hypot(*place) for place in places_mm], dtype=torch.float64)
    with torch.no_grad():
        slopes = tangents_for_heights(round_part(lens), heights, "a lens that is not round")
        shares = torch.where(heights > 0, slopes / heights, 0.0).tolist()
        return tuple(_field(lens, *at) for at in zip(places_mm, shares, strict=True))


def _field(lens: Lens, place_mm: tuple[float, float], share: float) -> Field:
    """Return the field of a place, from the slope per mm of the round lens."""
    x_mm, y_mm = place_mm
    across, along = share * x_mm, share * y_mm
    for _ in range(_STEPS):
        x, y = _landing(lens, across, along)
        dx, dy = x_mm - x, y_mm - y
        if math.hypot(dx, dy) < _TOLERANCE_MM:
            return Field(azimuth_rad=math.atan2(across, along), slope=math.hypot(across, along))
        ax, ay = _landing(lens, across + _DIFFERENCE, along)
        cx, cy = _landing(lens, across, along + _DIFFERENCE)
        xx, yx, xy, yy = ax - x, ay - y, cx - x, cy - y
        scale = _DIFFERENCE / (xx * yy - xy * yx)
        across += scale * (yy * dx - xy * dy)
        along += scale * (xx * dy - yx * dx)
    raise ContractError(f"no field reaches the place ({x_mm:g}, {y_mm:g}) mm of the sensor")


def _landing(lens: Lens, across: float, along: float) -> tuple[float, float]:
    """Return where the reference chief ray of the field (slope by x, by y) lands, in mm."""
    azimuth = math.atan2(across, along)
    turned = turned_lens(lens, azimuth)
    tensors = surface_tensors(
        turned, torch.tensor(lens.reference_wavelength_um, dtype=torch.float64)
    )
    slope = torch.tensor([[math.hypot(across, along)]], dtype=torch.float64)
    rays, _ = pupil_rays(turned, tensors, pupil_centre(), slope)
    end = trace(tensors, rays)
    if not bool(end.valid.all()):
        raise ContractError(
            f"the chief ray is lost at the field slopes ({across:g}, {along:g}); use a smaller "
            "sensor"
        )
    x, y = turned_back(end.x, end.y, azimuth)
    return float(x), float(y)
