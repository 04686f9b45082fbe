"""What earlier calibrations found, read back: geometry, tone curve, relative illumination."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator, RectBivariateSpline

from camkit.colorimetry import decode_srgb
from camkit.errors import DecodeError
from camkit.runtime.calibration.geometry.camera import LENS_NUMBERS, MODELS, Camera

FloatGrid = NDArray[np.float64]

NODES: Final = 64
"""Along the longer side of a picture, between which the undoing of distortion is interpolated."""
_ROUNDS: Final = 60
_DONE_PX: Final = 1e-6
_MOST_FOCAL: Final = 1e6
_TOP: Final = 255.0
_GAMMA: Final = 2.2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lens:
    """A camera of `camkit calibrate geometry` and the size of its pictures.

    Attributes:
        camera: The camera.
        size: Width and height, px.
        covered_px: Distance from the optical centre to which its distortion is known.
    """

    camera: Camera
    size: tuple[int, int]
    covered_px: float

    @classmethod
    def read(cls, path: Path) -> "Lens":
        """Read the TOML.

        Raises:
            DecodeError: If it is not what `camkit calibrate geometry` writes.
        """
        table = _read(path, "geometry")
        try:
            model = next(m for m in MODELS if m.name == table["model"])
            every = np.array(table["coefficients"], dtype=np.float64)
            numbers = [float(table["focal_px"]), *map(float, table["centre_px"])]
            found = cls(
                camera=Camera(
                    model=model, intrinsics=np.array([*numbers, *every[list(model.free)]])
                ),
                size=(int(table["width_px"]), int(table["height_px"])),
                covered_px=float(table["covered_radius_px"]),
            )
            lens = found.camera.intrinsics
            sound = len(numbers) == LENS_NUMBERS and len(every) == model.coefficients
            _check(sound and bool(np.isfinite(lens).all()), "numbers are missing or not finite")
            _check(1 < lens[0] < _MOST_FOCAL, "the focal length cannot be")
        except (KeyError, TypeError, ValueError, IndexError, StopIteration) as error:
            raise DecodeError(
                f"{path} does not hold what camkit calibrate geometry writes: {error!r}"
            ) from error
        return found

    def without_distortion(self, seen_px: FloatGrid) -> FloatGrid:
        """Give where (n, 2) places of a picture would lie without distortion, same focal length.

        Raises:
            DecodeError: If there is no such place.
        """
        camera = self.camera
        centre, focal = np.array(camera.centre_px), camera.focal_px
        at = np.asarray(seen_px, dtype=np.float64)
        off = np.zeros_like(at)
        for _ in range(_ROUNDS):
            off = self._distorted(at) - seen_px
            at = at - off
            if not np.isfinite(at).all() or np.abs(off).max(initial=0) < _DONE_PX:
                break
        if not np.abs(off).max(initial=0) < 1e-2:
            raise DecodeError(
                f"the distortion cannot be undone {np.hypot(*(seen_px - centre).T).max():.0f} px "
                f"from the optical centre (focal length {focal:.0f} px); it is known to "
                f"{self.covered_px:.0f} px: photograph the screen smaller, or calibrate farther out"
            )
        return at

    def lattice(self, x_px: FloatGrid, y_px: FloatGrid) -> FloatGrid:
        """Give (len(y), len(x), 2) places without distortion of a lattice of pixels."""
        step = max(self.size) / NODES
        nodes = [
            np.linspace(line[0], line[-1], max(8, int(np.ptp(line) / step) + 2))
            for line in (x_px, y_px)
        ]
        at = np.stack(np.meshgrid(*nodes), axis=-1)
        moved = (self.without_distortion(at.reshape(-1, 2)) - at.reshape(-1, 2)).reshape(at.shape)
        here = np.stack(np.meshgrid(x_px, y_px), axis=-1)
        for axis in (0, 1):
            spline = RectBivariateSpline(nodes[1], nodes[0], moved[..., axis], kx=3, ky=3)
            here[..., axis] += spline(y_px, x_px)
        return here

    def _distorted(self, ideal_px: FloatGrid) -> FloatGrid:
        camera = self.camera
        rays = (ideal_px - camera.centre_px) / camera.focal_px
        none, k = np.zeros(3), camera.coefficients
        if camera.model.fisheye:
            seen = cv2.fisheye.distortPoints(rays[None], camera.matrix, k)
        else:
            points = np.column_stack([rays, np.ones(len(rays))])
            seen, _ = cv2.projectPoints(points, none, none, camera.matrix, k)
        return np.asarray(seen, dtype=np.float64).reshape(-1, 2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tone:
    """Light of a display over what it is told.

    Attributes:
        light: (256,) of levels 0 to 255, 0 at black and 1 at white.
        measured: Whether somebody measured it; else it is the curve of sRGB.
    """

    light: FloatGrid
    measured: bool

    @classmethod
    def read(cls, path: Path | None) -> "Tone":
        """Read the TOML of `camkit calibrate tone`; sRGB without one.

        Black is taken off: it is the same in all that is shown.

        Raises:
            DecodeError: If it is not what that command writes, or does not reach from 0 to 255.
        """
        every = np.arange(_TOP + 1)
        if path is None:
            light = decode_srgb((every / _TOP).astype(np.float32)).astype(np.float64)
            return cls(light=light, measured=False)
        table = _read(path, "tone")
        try:
            levels = np.array(table["levels"], dtype=np.float64)
            light = np.array(table["luminance"], dtype=np.float64)
            rises = levels.ndim == 1 and len(levels) >= 2 and (np.diff(levels) > 0).all()
            _check(
                bool(rises and light.shape == levels.shape and (np.diff(light) >= 0).all()),
                "levels and luminance must rise together",
            )
            _check(
                bool(levels[0] <= 0 and levels[-1] >= _TOP and light[-1] > light[0] >= 0),
                "levels must reach from 0 to 255",
            )
        except (KeyError, TypeError, ValueError) as error:
            raise DecodeError(
                f"{path} does not hold what camkit calibrate tone writes: {error!r}"
            ) from error
        # a power of about 2.2 makes the curve nearly straight between steps
        share = (light - light[0]) / (light[-1] - light[0])
        root = PchipInterpolator(levels, share ** (1 / _GAMMA))(every)
        return cls(light=np.asarray(root**_GAMMA / root[-1] ** _GAMMA), measured=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Illumination:
    """Relative illumination of a lens, from `camkit calibrate flat`; even without one.

    Attributes:
        radii_px: (height,) distances from the centre; None for an even one.
        light: (height,) 1 in the centre.
        centre_px: x, y.
    """

    radii_px: FloatGrid | None = None
    light: FloatGrid | None = None
    centre_px: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def read(cls, path: Path | None, pixel_pitch_um: float | None) -> "Illumination":
        """Read the TOML.

        Raises:
            DecodeError: If it is not what `camkit calibrate flat` writes.
        """
        if path is None:
            return cls()
        table = _read(path, "flat")
        try:
            heights = np.array(table["heights_mm"], dtype=np.float64)
            light = np.array(table["relative_illumination"], dtype=np.float64)
            x, y = (float(n) for n in table["centre_px"])
            pitch_um = table.get("pixel_pitch_um", pixel_pitch_um)
            rises = heights.shape == light.shape and bool((np.diff(heights) > 0).all())
            _check(rises and bool((light > 0).all()), "heights must rise, light be > 0")
            _check(pitch_um is not None, "captures state no pixel pitch")
        except (KeyError, TypeError, ValueError) as error:
            raise DecodeError(
                f"{path} does not hold what camkit calibrate flat writes: {error!r}"
            ) from error
        return cls(radii_px=heights * 1000 / float(pitch_um or 1), light=light, centre_px=(x, y))

    def at(self, places_px: FloatGrid) -> FloatGrid:
        """Give the light (...) at places (..., 2) of a picture."""
        if self.radii_px is None or self.light is None:
            return np.ones(places_px.shape[:-1])
        radius = np.hypot(*np.moveaxis(places_px - np.array(self.centre_px), -1, 0))
        return np.asarray(np.interp(radius, self.radii_px, self.light))


def _check(sound: bool, what: str) -> None:
    if not sound:
        raise ValueError(what)


def _read(path: Path, command: str) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DecodeError(
            f"cannot read {path} as the TOML of camkit calibrate {command}: {error}"
        ) from error
