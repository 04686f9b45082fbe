"""The middle of a field's image: its peak, or its chief ray where no peak stands out.

A lens that is made for its axis alone has no peak far from it: the densest disc of its blur jumps
from one caustic to another, and kernels about it would have nothing in common.
"""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.spot import chief_heights, slopes_for_heights
from camkit.models_def.optics.thin.peak import land_light, peak_height_px, share_within
from camkit.units import to_mm

Array = NDArray[np.float64]
Middle = Literal["peak", "chief ray"]

PEAK: Final[Middle] = "peak"
CHIEF_RAY: Final[Middle] = "chief ray"
NEAR_PX: Final = 10.0
LEAST_NEAR: Final = 0.01
"""Of a field's light, within that distance: less is no peak."""
_CORNER_STEPS: Final = 12
MOST_RAD: Final = math.radians(80.0)
"""No field angle is sought beyond."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Middles:
    """The places about which the light of a lens is gathered.

    Attributes:
        middle: What it is.
        corner_rad: Field angle whose middle lies at the corner.
    """

    middle: Middle
    corner_rad: float

    def heights_px(self, lens: Lens, angles_rad: Array, pitch_um: float, rays: int) -> Array:
        """Return the middles (field,) of field angles from the axis, the first one 0.

        Raises:
            ContractError: If no light arrives.
        """
        if self.middle == CHIEF_RAY:
            slopes = torch.from_numpy(np.tan(angles_rad))
            with torch.no_grad():
                traced_px = chief_heights(lens, slopes).numpy() / to_mm(pitch_um)
        else:
            wave_um = lens.reference_wavelength_um
            traced_px = np.array([height_px(lens, a, wave_um, pitch_um, rays) for a in angles_rad])
        traced_px[angles_rad == 0] = 0.0
        return np.asarray(traced_px, np.float64)


def find_middles(
    lens: Lens, corner_px: float, pitch_um: float, rays: int, middle: Middle | None = None
) -> Middles:
    """Choose what the light of a lens is gathered about: peaks where the corner has one.

    Args:
        lens: With its grooves as they are.
        corner_px: Of the sensor, from the axis.
        pitch_um: Of the pixels.
        rays: In half the stop.
        middle: What was chosen for another state of the lens, and holds; None to choose.

    Raises:
        ContractError: If neither a peak nor a chief ray reaches the corner.
    """
    if middle == CHIEF_RAY:
        return _chief_rays(lens, corner_px, pitch_um)
    try:
        corner_rad = corner_angle_rad(lens, corner_px, pitch_um, rays)
    except ContractError as error:
        if middle == PEAK:
            raise
        try:
            return _chief_rays(lens, corner_px, pitch_um)
        except ContractError:
            raise error from None
    if middle == PEAK:
        return Middles(middle=PEAK, corner_rad=corner_rad)
    light = land_light(lens, corner_rad, lens.reference_wavelength_um, pitch_um, rays)
    if share_within(light, peak_height_px(light), NEAR_PX) >= LEAST_NEAR:
        return Middles(middle=PEAK, corner_rad=corner_rad)
    return _chief_rays(lens, corner_px, pitch_um)


def corner_angle_rad(lens: Lens, corner_px: float, pitch_um: float, rays: int) -> float:
    """Return the field angle whose peak lies at the corner, by bisection.

    Raises:
        ContractError: If none does.
    """
    low, high = 0.0, MOST_RAD
    wave_um = lens.reference_wavelength_um
    for _ in range(_CORNER_STEPS):
        middle = (low + high) / 2
        try:
            is_outside = height_px(lens, middle, wave_um, pitch_um, rays) > corner_px
        except ContractError:
            is_outside = True  # no light arrives from so far
        low, high = (low, middle) if is_outside else (middle, high)
    if abs(height_px(lens, low, wave_um, pitch_um, rays) / corner_px - 1) > 0.01:
        raise ContractError(
            f"no peak of {lens.name} reaches the corner, {corner_px:.0f} px from the axis: its "
            f"largest field is {math.degrees(low):.1f} degrees; use a smaller sensor"
        )
    return high


def height_px(lens: Lens, angle_rad: float, wave_um: float, pitch_um: float, rays: int) -> float:
    """Return the height of the peak of a field.

    Raises:
        ContractError: If no light arrives.
    """
    return peak_height_px(land_light(lens, float(angle_rad), wave_um, pitch_um, rays))


def _chief_rays(lens: Lens, corner_px: float, pitch_um: float) -> Middles:
    corner_mm = torch.tensor([corner_px * to_mm(pitch_um)], dtype=torch.float64)
    slope = float(slopes_for_heights(lens, corner_mm)[0])
    return Middles(middle=CHIEF_RAY, corner_rad=math.atan(slope))
