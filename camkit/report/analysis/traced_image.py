"""Images of points by the rays of a lens, grooves and walls as they are (needs torch).

    angle -> rays of every wavelength of the sensor's middle colour -> peak, lines, shares

Nothing is cut off: haze counts however far it falls.
"""

import math
from typing import Final

import numpy as np
import scipy.ndimage
import torch

from camkit.bundle.sensor import ColorSensor
from camkit.errors import ContractError
from camkit.models_def.optics.frozen import corner_height_mm
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.render.illumination import relative_illumination_at
from camkit.models_def.optics.thin.hazy_freezing import flat_light
from camkit.models_def.optics.thin.middle import corner_angle_rad
from camkit.models_def.optics.thin.peak import LandedLight, land_light, peak_height_px, share_within
from camkit.report.analysis.point_image import (
    FAR_PX,
    NEAR_PX,
    PATCH_PX,
    Array,
    Band,
    PointImage,
)
from camkit.units import to_mm

RAYS: Final = 40_000
"""In half the stop, for each wavelength."""
SEARCH_RAYS: Final = 8_000
SMOOTH_RAYS: Final = 100
"""A place of the patch is the mean of at least so many rays and their mirror images."""
LEAST_SMOOTH_PX: Final = 0.3
MIDDLE_PX: Final = 2.5
"""Radius of the disc about the peak in which rays are counted for that."""


def traced_images(
    lens: Lens, sensor: ColorSensor, band: Band, fields: int, *, rays: int = RAYS
) -> list[PointImage]:
    """Trace points from the axis to the sensor's corner, as far as light reaches the sensor.

    Args:
        lens: The prescription.
        sensor: Its corner and its pixels.
        band: Colour of the points.
        fields: How many, evenly spaced in angle.
        rays: In half the stop, for each wavelength.

    Raises:
        ContractError: If no light arrives on the axis.
    """
    pitch_um = sensor.known_extent.pixel_pitch_um
    angles = np.linspace(0.0, last_angle_rad(lens, sensor), fields)
    lights = [land_band(lens, float(angle), band, pitch_um, rays) for angle in angles]
    heights = np.array([peak_height_px(light) for light in lights])
    heights[0] = 0.0
    lit = _illumination(lens, heights, pitch_um)
    return [
        image_of(light, float(height), float(angle), to_mm(pitch_um), float(even))
        for light, height, angle, even in zip(lights, heights, angles, lit, strict=True)
    ]


def last_angle_rad(lens: Lens, sensor: ColorSensor) -> float:
    """Return the angle whose peak lies at the corner; where none does, the ideal one's."""
    pitch_um = sensor.known_extent.pixel_pitch_um
    corner_mm = corner_height_mm(sensor)
    try:
        return corner_angle_rad(lens, corner_mm / to_mm(pitch_um), pitch_um, SEARCH_RAYS)
    except ContractError:
        return math.atan(corner_mm / paraxial_data(lens).efl_mm)


def land_band(lens: Lens, angle_rad: float, band: Band, pitch_um: float, rays: int) -> LandedLight:
    """Trace a field in a colour."""
    waves_um, weights = band.wavelengths_um, band.weights
    parts = [land_light(lens, angle_rad, float(wave), pitch_um, rays) for wave in waves_um]
    lost_shares: dict[str, float] = {}
    for part, weight in zip(parts, weights, strict=True):
        for fate, share in part.losses.items():
            lost_shares[fate] = lost_shares.get(fate, 0.0) + float(weight) * share
    return LandedLight(
        x_px=np.concatenate([part.x_px for part in parts]),
        y_px=np.concatenate([part.y_px for part in parts]),
        share=np.concatenate([w * p.share for p, w in zip(parts, weights, strict=True)]),
        losses=lost_shares,
    )


def image_of(
    light: LandedLight, height_px: float, angle_rad: float, pitch_mm: float, illumination: float
) -> PointImage:
    """Return the image of a point of rays with x >= 0 in the pupil, their mirror images added."""
    total = float(light.share.sum())
    x, y, share = light.x_px, light.y_px - height_px, light.share / total
    columns, rows = np.rint(x), np.rint(y)
    tangential = _line(np.concatenate([columns, -columns]), np.concatenate([share, share]) / 2)
    return PointImage(
        height_mm=height_px * pitch_mm,
        field_angle_rad=angle_rad,
        patch=_patch(rows, columns, share),
        lines={"radial": _line(rows, share), "tangential": tangential},
        near_share=share_within(light, height_px, NEAR_PX) / total,
        far_share=share_within(light, height_px, FAR_PX) / total,
        lost_share=max(1 - total, 0.0),
        illumination=illumination,
    )


def _line(place: Array, share: Array) -> Array:
    reach = int(np.abs(place).max())
    counts = np.bincount((place + reach).astype(np.intp), share, minlength=2 * reach + 1)
    return np.asarray(counts, np.float64)


def _patch(rows: Array, columns: Array, share: Array) -> Array:
    side = 2 * PATCH_PX + 1
    inside = (np.abs(rows) <= PATCH_PX) & (np.abs(columns) <= PATCH_PX)
    place = ((rows + PATCH_PX) * side + columns + PATCH_PX)[inside].astype(np.intp)
    counts = np.bincount(place, share[inside], minlength=side * side).reshape(side, side)
    patch = np.asarray((counts + counts[:, ::-1]) / 2, np.float64)
    # where rays lie thinly their chance is no peak: every place is the mean of so many
    near = int((np.hypot(rows, columns) < MIDDLE_PX).sum()) / (np.pi * MIDDLE_PX**2)
    sigma_px = np.sqrt(SMOOTH_RAYS / (8 * np.pi * max(near, 1e-3)))
    if sigma_px > LEAST_SMOOTH_PX:
        patch = scipy.ndimage.gaussian_filter(patch, sigma_px, mode="constant")
    return np.asarray(patch)


def _illumination(lens: Lens, heights_px: Array, pitch_um: float) -> Array:
    """Return how an even scene lights the sensor, (n,) of heights (n,), 1 on the axis.

    Haze counts; a lens none of whose peaks lies at the corner is taken by its chief rays.
    """
    # where peaks jump, a height that lies further in than one before it is known by its neighbours
    rising = np.flatnonzero(np.diff(np.maximum.accumulate(heights_px), prepend=-1.0) > 0)
    rising_px = heights_px[rising]
    try:
        lit = flat_light(lens, rising_px, pitch_um, rays=SEARCH_RAYS)
    except ContractError:
        at_mm = torch.from_numpy(rising_px * to_mm(pitch_um))
        lit = relative_illumination_at(lens, at_mm).numpy()
        lit = lit / lit[0]
    return np.interp(heights_px, rising_px, lit)
