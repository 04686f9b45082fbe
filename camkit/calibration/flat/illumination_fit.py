"""Pictures of one display in different poses to the relative illumination of a lens."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.flat.picture import FlatPicture, check_one_camera, read_flat
from camkit.calibration.flat.pose import Pose, orientation_turn_deg, poses_of
from camkit.calibration.flat.separate import MOST_OFFSET, Parts, Views, separate
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.progress import counted
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.units import to_mm

FloatGrid = NDArray[np.float64]

HEIGHTS: Final = 17
MOST_REST: Final = 0.01
MUCH_BETTER: Final = 0.5
SURE_REST: Final = 0.001
_REVERSALS: Final = {
    (True, False): "the shifts",
    (False, True): "the turns",
    (True, True): "shifts and turns",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class FlatFacts:
    """The measured relative illumination of a lens.

    Attributes:
        files: Names of the pictures.
        poses: Of the pictures.
        heights_mm: (height,) distances from the optical centre on the sensor.
        relative_illumination: (height,) 1 at the centre.
        pixel_pitch_um: By which heights are those of the pictures.
        size_px: Width and height of the sensor where pictures state their place on it, else theirs.
        centre_px: (x, y) of the optical centre on it.
        centre_found: Whether it was fitted.
        separated: Whether lens and display were told apart.
        display: Unevenness of what is photographed, as far as it was seen: a share of its
            brightest place.
        display_maps: (picture, row, column) what is photographed, as each picture sees it.
        rest_maps: (picture, row, column) what lens and display leave, as a share.
        notes: What the user should know.
    """

    files: tuple[str, ...]
    poses: tuple[Pose, ...]
    heights_mm: FloatGrid
    relative_illumination: FloatGrid
    pixel_pitch_um: float
    size_px: tuple[int, int]
    centre_px: tuple[float, float]
    centre_found: bool
    separated: bool
    display: float
    display_maps: FloatGrid
    rest_maps: FloatGrid
    notes: tuple[str, ...]

    @property
    def rest(self) -> float:
        """Return the RMS of the residuals, as a share."""
        return float(np.sqrt(np.mean(self.rest_maps**2)))

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "separated": self.separated,
            "heights_mm": [round(float(h), 5) for h in self.heights_mm],
            "relative_illumination": [round(float(v), 5) for v in self.relative_illumination],
            "pixel_pitch_um": self.pixel_pitch_um,
            "width_px": self.size_px[0],
            "height_px": self.size_px[1],
            "display_percent": round(100 * self.display, 3),
            "residual_percent": round(100 * self.rest, 4),
            "centre_px": [round(part, 2) for part in self.centre_px],
            "centre_found": self.centre_found,
            "notes": list(self.notes),
            "pictures": [
                {
                    "file": name,
                    "shift_px": list(pose.shift_px),
                    "turn_deg": round(math.degrees(pose.turn_rad), 6),
                }
                for name, pose in zip(self.files, self.poses, strict=True)
            ],
        }


def measure_flat(
    files: Sequence[Path],
    shifts: Sequence[str | tuple[float, float]] | None,
    turns: Sequence[float] | None,
    *,
    pixel_pitch_um: float | None = None,
    mosaic: MosaicOptions | None = None,
) -> FlatFacts:
    """Measure the fall-off of light towards the corner.

    Args:
        files: Linear pictures of one display or wall.
        shifts: See `pose.poses_of`.
        turns: See `pose.poses_of`.
        pixel_pitch_um: None for what the pictures state.
        mosaic: What files do not say of themselves.

    Raises:
        ContractError: If poses do not fit the pictures in number or by what the pictures show, or
            no pitch is known.
        DecodeError: If a picture cannot be read or used.
    """
    if pixel_pitch_um is not None and not 0 < pixel_pitch_um < math.inf:
        raise ContractError(f"{option_text('pixel_pitch_um')} must be > 0; got {pixel_pitch_um:g}")
    if len({path.resolve() for path in files}) < len(files):
        raise ContractError("a picture is given twice; give every one once")
    poses_of(shifts, turns, [0.0] * len(files))  # refuses what is wrong before any work
    pictures = [read_flat(path, mosaic) for path in counted(files, "reading", "pictures")]
    poses = poses_of(shifts, turns, [orientation_turn_deg(p.like.orientation) for p in pictures])
    for picture in pictures[1:]:
        check_one_camera(pictures[0].like, files[0], picture.like, picture.path)
    like = pictures[0].like
    pitch_um = pixel_pitch_um or like.pixel_pitch_um
    if pitch_um is None:
        raise ContractError(
            f"the pictures state no pixel pitch; add {option_text('pixel_pitch_um')}"
        )
    radius_px = math.hypot(like.width, like.height) / 2
    views = _views(pictures, poses, radius_px)
    parts = separate(views)
    if parts.separated:
        _refuse_reversed(views, parts)
    # as far as there are blocks; beyond them nothing is known
    farthest = np.hypot(views.x - parts.centre[0], views.y - parts.centre[1]).max()
    radii = np.linspace(0, float(farthest), HEIGHTS)
    shape = (len(pictures), *pictures[0].light.shape)
    size, origin = _place(like)
    return FlatFacts(
        files=tuple(path.name for path in files),
        poses=tuple(poses),
        heights_mm=radii * radius_px * to_mm(pitch_um),
        relative_illumination=parts.illumination(radii),
        pixel_pitch_um=float(pitch_um),
        size_px=size,
        centre_px=(
            origin[0] + (like.width - 1) / 2 + parts.centre[0] * radius_px,
            origin[1] + (like.height - 1) / 2 + parts.centre[1] * radius_px,
        ),
        centre_found=parts.centre_found,
        separated=parts.separated,
        display=1 - math.exp(float(parts.display.min() - parts.display.max())),
        display_maps=np.exp(parts.display - parts.display.max()).reshape(shape),
        rest_maps=parts.rest.reshape(shape),
        notes=tuple(_notes(parts, len(pictures))),
    )


def _views(pictures: Sequence[FlatPicture], poses: Sequence[Pose], radius_px: float) -> Views:
    """Return the pictures in units of half their diagonal, from their middle.

    Raises:
        DecodeError: If the optical centre lies outside of them.
    """
    one = pictures[0]
    x, y = np.meshgrid(
        (one.x_px - (one.like.width - 1) / 2) / radius_px,
        (one.y_px - (one.like.height - 1) / 2) / radius_px,
    )
    centre = _sensor_middle(one.like, radius_px)
    if abs(centre[0]) > float(x.max()) or abs(centre[1]) > float(y.max()):
        raise DecodeError(
            f"{one.path.name} is a crop that the optical centre does not lie in; give pictures of "
            "the whole sensor"
        )
    scaled = tuple(
        Pose(
            shift_px=(pose.shift_px[0] / radius_px, pose.shift_px[1] / radius_px),
            turn_rad=pose.turn_rad,
        )
        for pose in poses
    )
    return Views(
        log_light=np.log(np.stack([picture.light.ravel() for picture in pictures])),
        x=x.ravel(),
        y=y.ravel(),
        poses=scaled,
        centre=centre,
        reach=1 + math.hypot(*centre) + MOST_OFFSET,
        width=max(one.like.width, one.like.height) / radius_px,
    )


def _sensor_middle(like: Capture, radius_px: float) -> tuple[float, float]:
    """Return the middle of the sensor from that of a picture, in units of half its diagonal."""
    x, y = (
        ((whole - side) / 2 - origin) / radius_px
        for whole, origin, side in zip(*_place(like), (like.width, like.height), strict=True)
    )
    return x, y


def _place(like: Capture) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the size of the sensor and where a picture begins on it; alone, it is all of it."""
    if like.origin_px is None or like.sensor_size_px is None:
        return (like.width, like.height), (0, 0)
    return like.sensor_size_px, like.origin_px


def _refuse_reversed(views: Views, parts: Parts) -> None:
    """Refuse poses that fit far better with the opposite sign.

    Raises:
        ContractError: If they do.
    """
    if parts.rms < SURE_REST:
        return
    reversals = {}
    for (shift, turn), what in _REVERSALS.items():
        poses = tuple(pose.reversed(shift=shift, turn=turn) for pose in views.poses)
        reversals[separate(replace(views, poses=poses)).rms] = what
    least = min(reversals)
    if least < MUCH_BETTER * parts.rms:
        raise ContractError(
            f"the pictures fit with {reversals[least]} reversed ({least:.2%} are left, "
            f"{parts.rms:.2%} as they are); check how the object moved in the picture: right, down "
            "and clockwise are positive"
        )


def _notes(parts: Parts, count: int) -> list[str]:
    notes = []
    if not parts.separated:
        why = "one picture does not tell" if count == 1 else "these poses do not tell"
        notes.append(
            f"{why} the lens from what is photographed: what both explain counts as the lens's; "
            "shift the camera by a third of the picture, to the side and up, and turn it once"
        )
    elif not parts.centre_found:
        notes.append("the pictures do not determine the optical centre; the middle is used")
    if parts.rms > MOST_REST:
        notes.append(
            f"lens and display leave {parts.rms:.2%} of the light: a pose may be wrong, or there "
            "is an edge in a picture"
        )
    return notes
