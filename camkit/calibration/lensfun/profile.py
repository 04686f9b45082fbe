"""The lens profile of a lens for captures like one: units brought to that sensor's millimetres."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.optics import IlluminationEntry, LensProfile, RadialEntry
from camkit.calibration.lensfun.database import Lens
from camkit.calibration.lensfun.interpolation import distortion_at, vignetting_at
from camkit.calibration.lensfun.models import (
    FULL_FRAME_MM,
    Distortion,
    Vignetting,
    corner_mm,
    unit_mm,
)
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.runtime.geometry.distortion import (
    RANGE_MARGIN,
    check_distortion,
    distort_points,
    undistort_points,
)
from camkit.units import to_mm

SMALLER: Final = 0.96
"""A lens measured on a sensor smaller than this share of the capture's does not serve."""
HEIGHTS: Final = 129
CHECKED: Final = 1001
_SEEN_PX: Final = 0.5
"""Less of a border's repetition is not worth a scale of one's own."""
RADIAL_KIND: Final = "rectilinear"


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """The captures for which a profile is made.

    Attributes:
        size_px: Width and height.
        pitch_um: Pixel pitch.
        crop_factor: By which lensfun knows the sensor.
        channels: Of the sensor.
    """

    size_px: tuple[int, int]
    pitch_um: float
    crop_factor: float
    channels: int

    @property
    def corner_radius_mm(self) -> float:
        """Return the distance of the outermost pixel from the middle."""
        width, height = self.size_px
        return math.hypot(width - 1, height - 1) / 2 * to_mm(self.pitch_um)

    @property
    def border_radii_mm(self) -> NDArray[np.float64]:
        """Return distances of the outermost rows and columns from the middle."""
        nearest_mm = (min(self.size_px) - 1) / 2 * to_mm(self.pitch_um)
        return np.linspace(nearest_mm, self.corner_radius_mm, CHECKED)

    @property
    def stretch(self) -> float:
        """Return the diagonal by pixels over that by the crop factor: 1 where both are exact."""
        return math.hypot(*self.size_px) * to_mm(self.pitch_um) * self.crop_factor / FULL_FRAME_MM


@dataclass(frozen=True, slots=True, kw_only=True)
class LensfunProfile:
    """A profile, and its sources.

    Attributes:
        profile: What the manifest holds.
        lens: As it was measured.
        distortion: The entry, interpolated where none was measured.
        vignetting: The entry; None for none.
        scale: Of ideal radii: the straight picture is larger than lensfun's by 1 / scale.
        residual_px: The most by which the profile misses lensfun's formula over the picture.
        notes: What people should know.
    """

    profile: LensProfile
    lens: Lens
    distortion: Distortion
    vignetting: Vignetting | None
    scale: float
    residual_px: float
    notes: tuple[str, ...]


def profile_of(
    lenses: Sequence[Lens],
    focal_mm: float,
    frame: Frame,
    *,
    aperture: float | None = None,
    distance_m: float | None = None,
    scale: float | None = None,
) -> LensfunProfile:
    """Make a profile.

    Args:
        lenses: One lens, as measured with several cameras.
        focal_mm: Focal length.
        frame: Of the captures.
        aperture: F-number of the captures; None where they state none.
        distance_m: Of the object.
        scale: Of ideal radii; None for `filling_scale`.

    Raises:
        DecodeError: If the lens was not measured on a sensor so large or at that focal length, has
            no distortion, or one that folds back inside the picture.
    """
    lens = _measured_on(lenses, frame)
    entry = distortion_at(lens, focal_mm)
    radius_mm = unit_mm(lens.crop_factor, lens.aspect) * frame.stretch
    as_measured = entry.to_radial(radius_mm, frame.channels)
    try:
        check_distortion(as_measured.to_distortion(), frame.corner_radius_mm)
        ideal_scale = filling_scale(as_measured, frame) if scale is None else scale
        distortion = entry.to_radial(radius_mm, frame.channels, ideal_scale)
        check_distortion(distortion.to_distortion(), frame.corner_radius_mm)
    except ContractError as error:
        raise DecodeError(
            f"{lens.name} at {entry.focal_mm:g} mm ({entry.model}) folds back inside the picture, "
            f"so it cannot be undone: {str(error).split(';')[0]}"
        ) from error
    notes = []
    if scale is None and ideal_scale < 1:
        notes.append(f"the picture is enlarged by {1 / ideal_scale:.4f}, so that nothing beyond the capture shows")  # noqa: E501 # fmt: skip
    if len({one.model for one in lens.distortion}) > 1:
        notes.append(f"entries of other models than {entry.model} are left out, as lensfun does")
    if lens.kind != RADIAL_KIND:
        notes.append(f"the lens is {lens.kind}: its projection stays, only what departs from it")
    nearest = vignetting_at(lens, focal_mm, aperture, distance_m)
    light = None
    if nearest is None:
        notes.append("the database has no vignetting of this lens; light is not evened")
    else:
        light = _illumination(nearest, lens, frame)
        notes.append(_vignetting_note(nearest, aperture, distance_m))
        if light is None:
            notes.append("that vignetting leaves no light inside the picture; light is not evened")
    return LensfunProfile(
        profile=LensProfile(distortion=distortion, illumination=light),
        lens=lens,
        distortion=entry,
        vignetting=None if light is None else nearest,
        scale=ideal_scale,
        residual_px=missed_px(entry, distortion, frame, ideal_scale),
        notes=tuple(notes),
    )


def filling_scale(distortion: RadialEntry, frame: Frame) -> float:
    """Return the largest scale <= 1 of ideal radii at which no border is empty.

    Where the border of the straight picture lies at a distance r, and d(r) > r is where the capture
    is asked for, the scale is at most d^-1(r) / r.

    Args:
        distortion: As measured, without folds over the picture.
        frame: Of the captures.
    """
    radii_mm, rows = frame.border_radii_mm, distortion.to_distortion()
    scale = 1.0
    for channel in range(frame.channels):
        points = np.stack([radii_mm, np.zeros(radii_mm.size)], axis=-1)
        placed_mm = distort_points(points, rows, channel=channel)[:, 0]
        empty = points[placed_mm > radii_mm + _SEEN_PX * to_mm(frame.pitch_um)]
        if empty.size:
            ideal = undistort_points(empty, rows, channel=channel)
            scale = min(scale, float((ideal[:, 0] / empty[:, 0]).min()))
    return scale


def missed_px(
    entry: Distortion, distortion: RadialEntry, frame: Frame, scale: float = 1.0
) -> float:
    """Return the largest error of a profile against lensfun's formula, in pixels of the picture."""
    ideal_mm = np.linspace(0, frame.corner_radius_mm, CHECKED)
    placed_mm = (
        entry.captured_radius(scale * ideal_mm / distortion.radius_mm) * distortion.radius_mm
    )
    points = np.stack([ideal_mm, np.zeros(CHECKED)], axis=-1)
    rows = distortion.to_distortion()
    missed = [
        np.abs(distort_points(points, rows, channel=channel)[:, 0] - placed_mm).max()
        for channel in range(frame.channels)
    ]
    return float(max(missed)) / to_mm(frame.pitch_um)


def _measured_on(lenses: Sequence[Lens], frame: Frame) -> Lens:
    """Choose the smallest sensor that holds that of the captures, as lensfun does."""
    measured = [lens for lens in lenses if lens.distortion]
    if not measured:
        raise DecodeError(f"{lenses[0].file} has no distortion of {lenses[0].name}")
    large = [lens for lens in measured if frame.crop_factor / lens.crop_factor >= SMALLER]
    if not large:
        crops = ", ".join(f"{lens.crop_factor:g}" for lens in measured)
        raise DecodeError(
            f"{measured[0].name} was measured with crop factor {crops}; the captures have "
            f"{frame.crop_factor:.3g}, a larger sensor, whose corners were not "
            f"measured; add {option_text('crop_factor')} if they are a part of it"
        )
    return max(large, key=lambda lens: lens.crop_factor)


def _illumination(entry: Vignetting, lens: Lens, frame: Frame) -> IlluminationEntry | None:
    end_mm = frame.corner_radius_mm * RANGE_MARGIN
    heights_mm = end_mm * np.sqrt(np.linspace(0, 1, HEIGHTS))
    light = entry.light(heights_mm / (corner_mm(lens.crop_factor) * frame.stretch))
    if not (light > 1e-3).all():
        return None
    return IlluminationEntry(
        heights_mm=tuple(heights_mm.tolist()), relative_illumination=tuple(light.tolist())
    )


def _vignetting_note(entry: Vignetting, aperture: float | None, distance_m: float | None) -> str:
    """Return notes on the vignetting that was used, and on the one asked for."""
    aperture_text = "smallest aperture" if aperture is None else f"f/{aperture:g}"
    where = "far away" if distance_m is None else f"{distance_m:g} m"
    return (
        f"vignetting is that measured at {entry.focal_mm:g} mm, f/{entry.aperture:g}, "
        f"{entry.distance_m:g} m, the nearest to {aperture_text}, {where}"
    )
