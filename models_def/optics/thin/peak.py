"""The share of a point's light near the peak of its image, and the reach of the haze.

The peak is the densest place of the meridian: the middle of the disc of 5 px radius that holds
most light. Shares are of all light that enters the stop, so what grooves take counts as missing.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens, require_round
from camkit.models_def.optics.pupil import half_disc, pupil_rays
from camkit.models_def.optics.trace import Fate, surface_tensors, trace
from camkit.units import to_mm

PEAK_PX: Final = 5.0
RADII_PX: Final = (5.0, 10.0, 50.0, 450.0, 900.0)
RAYS: Final = 40_000
# along the meridian: bins, how many of the fullest are looked at, and how finely
_BIN_PX: Final = 1.0
_CANDIDATES: Final = 12
_FINE_PX: Final = (-0.25, 0.25)
_ROUNDS: Final = 3
_INNER: Final = 0.8
_POINT_SHARE: Final = 0.95
"""Of the light of a disc, within its inner part: then the point ends inside the disc."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class LandedLight:
    """Light of a field on the sensor, mirrored at x = 0.

    Attributes:
        x_px: (ray,), >= 0 in the pupil.
        y_px: (ray,), from the axis.
        share: (ray,), of the light that enters; lost rays are left out.
        losses: Share of the light by fate.
    """

    x_px: Array
    y_px: Array
    share: Array
    losses: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """The image of a point.

    Attributes:
        field_angle_rad: Of the point.
        height_px: Of the peak, from the axis.
        shares: Share of the light within each of `RADII_PX` of the peak.
        losses: Share of the light by fate; none for those that took none.
    """

    field_angle_rad: float
    height_px: float
    shares: tuple[float, ...]
    losses: dict[str, float]

    def within_px(self, radius_px: float) -> float:
        """Return the share within one of `RADII_PX`."""
        return self.shares[RADII_PX.index(radius_px)]


def land_light(
    lens: Lens, field_angle_rad: float, wavelength_um: float, pitch_um: float, rays: int = RAYS
) -> LandedLight:
    """Trace a field to the sensor.

    Raises:
        ContractError: If no light enters the stop.
    """
    require_round(lens, "a landing from half the pupil")
    tensors = surface_tensors(lens, torch.tensor(wavelength_um, dtype=torch.float64))
    slope = torch.tensor([math.tan(field_angle_rad)], dtype=torch.float64)
    with torch.no_grad():
        launched, weight = pupil_rays(lens, tensors, half_disc(rays), slope)
        landings = trace(tensors, launched)
    total = float(weight.sum())
    if not total > 0:
        raise ContractError("no light enters the stop; use smaller fields")
    share = (weight / total).numpy()
    alive, fates = landings.valid.numpy(), landings.fate.numpy()
    losses = {
        fate.name.lower(): float(share[fates == fate].sum())
        for fate in Fate
        if fate is not Fate.VALID and (fates == fate).any()
    }
    scale = 1 / to_mm(pitch_um)
    return LandedLight(
        x_px=(landings.x.numpy() * scale)[alive],
        y_px=(landings.y.numpy() * scale)[alive],
        share=share[alive],
        losses=losses,
    )


def peak_height_px(light: LandedLight) -> float:
    """Return the place of the peak on the meridian: the middle of the disc of most light.

    A point smaller than the disc fills many discs, and which of them holds most is chance: its
    place is its centre of gravity.

    Raises:
        ContractError: If no light arrives near the meridian.
    """
    near = np.abs(light.x_px) < PEAK_PX
    if not near.any():
        raise ContractError("no light reaches the meridian of the sensor; use smaller fields")
    y_px, share = light.y_px[near], light.share[near]
    low = math.floor(float(y_px.min())) - PEAK_PX
    edges = np.arange(low, float(y_px.max()) + PEAK_PX + _BIN_PX, _BIN_PX)
    count, _ = np.histogram(y_px, bins=edges, weights=share)
    wide = np.convolve(count, np.ones(int(2 * PEAK_PX / _BIN_PX)), "same")
    middles = edges[np.argsort(wide)[-_CANDIDATES:]]
    places = (middles[:, None] + np.array(_FINE_PX)).ravel()
    best = float(max(places, key=lambda place: share_within(light, float(place), PEAK_PX)))
    return _middle_of_point_px(light, best)


def _middle_of_point_px(light: LandedLight, best_px: float) -> float:
    """Return the centre of gravity of a point smaller than the disc at a place, else the place."""
    middle_px = best_px
    for _ in range(_ROUNDS):
        near = np.hypot(light.x_px, light.y_px - middle_px) < PEAK_PX
        total = float(light.share[near].sum())
        if total <= 0:
            return best_px
        middle_px = float((light.share[near] * light.y_px[near]).sum()) / total
    whole = share_within(light, middle_px, PEAK_PX)
    smaller = share_within(light, middle_px, _INNER * PEAK_PX) >= _POINT_SHARE * whole > 0
    return middle_px if smaller else best_px


def share_within(light: LandedLight, height_px: float, radius_px: float) -> float:
    """Return the share of the light within a distance of a place on the meridian."""
    near = np.hypot(light.x_px, light.y_px - height_px) < radius_px
    return float(light.share[near].sum())


def measure_peak(
    lens: Lens, field_angle_rad: float, wavelength_um: float, pitch_um: float, rays: int = RAYS
) -> Peak:
    """Measure the image of a point.

    Args:
        lens: With its grooves as they are.
        field_angle_rad: Of the point.
        wavelength_um: Of the light.
        pitch_um: Of the pixels.
        rays: In half the stop.

    Raises:
        ContractError: If no light arrives.
    """
    light = land_light(lens, field_angle_rad, wavelength_um, pitch_um, rays)
    height_px = peak_height_px(light)
    return Peak(
        field_angle_rad=field_angle_rad,
        height_px=height_px,
        shares=tuple(share_within(light, height_px, radius) for radius in RADII_PX),
        losses=light.losses,
    )
