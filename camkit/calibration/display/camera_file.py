"""Results of earlier calibrations, for captures of a display: lens, tone curve, illumination."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

from camkit.calibration.geometry.camera_model import MODELS, Camera
from camkit.calibration.measured_files import (
    read_flat,
    read_geometry,
)
from camkit.errors import DecodeError
from camkit.radial import RadialIllumination
from camkit.runtime.files.formats.color_space import srgb_curve
from camkit.runtime.signal.tone_curve import TOP_LEVEL, measured_light
from camkit.units import to_mm

FloatGrid = NDArray[np.float64]

MOST_FOCAL_PX: Final = 1e6
NODES: Final = 64
"""Along the longer side of a picture, between which the undoing of distortion is interpolated."""
_ROUNDS: Final = 60
_DONE_PX: Final = 1e-6


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
            DecodeError: If it is not what `camkit calibrate geometry` writes, or no such lens.
        """
        file = read_geometry(path)
        model = next((m for m in MODELS if m.name == file.model), None)
        if model is None or file.focal_px is None or file.coefficients is None:
            raise DecodeError(f"{path} states no camera; write it with camkit calibrate geometry")
        if len(file.coefficients) != model.coefficients:
            raise DecodeError(
                f"{path}: {model.name} has {model.coefficients} coefficients; got "
                f"{len(file.coefficients)}"
            )
        if not 1 < file.focal_px < MOST_FOCAL_PX:
            raise DecodeError(f"{path}: a focal length of {file.focal_px:g} px cannot be")
        free = [file.coefficients[number] for number in model.free]
        return cls(
            camera=Camera(
                model=model, intrinsics=np.array([file.focal_px, *file.centre_px, *free])
            ),
            size=(file.width_px, file.height_px),
            covered_px=file.covered_radius_px,
        )

    def without_distortion(self, seen_px: FloatGrid) -> FloatGrid:
        """Return (n, 2) places of a picture without distortion, at the same focal length.

        Raises:
            DecodeError: If there is no such place.
        """
        camera = self.camera
        centre, focal = np.array(camera.centre_px), camera.focal_px
        at = np.asarray(seen_px, dtype=np.float64)
        error = np.zeros_like(at)
        for _ in range(_ROUNDS):
            error = self._distorted(at) - seen_px
            at = at - error
            if not np.isfinite(at).all() or np.abs(error).max(initial=0) < _DONE_PX:
                break
        if not np.abs(error).max(initial=0) < 1e-2:
            raise DecodeError(
                f"the distortion cannot be undone {np.hypot(*(seen_px - centre).T).max():.0f} px "
                f"from the optical centre (focal length {focal:.0f} px); it is known to "
                f"{self.covered_px:.0f} px: photograph the screen smaller, or calibrate farther out"
            )
        return at

    def lattice(self, x_px: FloatGrid, y_px: FloatGrid) -> FloatGrid:
        """Return (len(y), len(x), 2) places without distortion of a lattice of pixels."""
        step = max(self.size) / NODES
        nodes = [
            np.linspace(line[0], line[-1], max(8, int(np.ptp(line) / step) + 2))
            for line in (x_px, y_px)
        ]
        at = np.stack(np.meshgrid(*nodes), axis=-1)
        shift = (self.without_distortion(at.reshape(-1, 2)) - at.reshape(-1, 2)).reshape(at.shape)
        here = np.stack(np.meshgrid(x_px, y_px), axis=-1)
        for axis in (0, 1):
            spline = RectBivariateSpline(nodes[1], nodes[0], shift[..., axis], kx=3, ky=3)
            here[..., axis] += spline(y_px, x_px)
        return here

    def _distorted(self, ideal_px: FloatGrid) -> FloatGrid:
        camera = self.camera
        rays = (ideal_px - camera.centre_px) / camera.focal_px
        none, k = np.zeros(3), camera.coefficients
        if camera.model.fisheye:
            distorted = cv2.fisheye.distortPoints(rays[None], camera.matrix, k)
        else:
            points = np.column_stack([rays, np.ones(len(rays))])
            distorted, _ = cv2.projectPoints(points, none, none, camera.matrix, k)
        return np.asarray(distorted, dtype=np.float64).reshape(-1, 2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tone:
    """Light of a display over its input levels.

    Attributes:
        light: (256,) of levels 0 to 255, 0 at black and 1 at white.
        measured: Whether somebody measured it; else it is the curve of sRGB.
    """

    light: FloatGrid
    measured: bool

    @classmethod
    def read(cls, path: Path | None) -> "Tone":
        """Read the TOML of `camkit calibrate tone`; sRGB without one.

        Raises:
            DecodeError: If it is not what that command writes, or does not reach from 0 to 255.
        """
        if path is None:
            light = srgb_curve(np.arange(TOP_LEVEL + 1) / TOP_LEVEL)
            return cls(light=light, measured=False)
        return cls(light=measured_light(path), measured=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Illumination:
    """Relative illumination of a lens, from `camkit calibrate flat`; even without one.

    Attributes:
        light: Over the height; None for an even one.
        pitch_mm: Of the pixels.
        centre_px: x, y.
    """

    light: RadialIllumination | None = None
    pitch_mm: float = 1.0
    centre_px: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def read(cls, path: Path | None, size: tuple[int, int]) -> "Illumination":
        """Read the TOML.

        Args:
            path: The file; None for an even one.
            size: Width and height of the pictures that it is for.

        Raises:
            DecodeError: If it is not what `camkit calibrate flat` writes, or of another size.
        """
        if path is None:
            return cls()
        file = read_flat(path)
        if (file.width_px, file.height_px) not in (size, (None, None)):
            raise DecodeError(
                f"{path} is of {file.width_px}x{file.height_px} px, the geometry of "
                f"{size[0]}x{size[1]}; give both of one camera"
            )
        return cls(
            light=file.to_entry().to_illumination(),
            pitch_mm=to_mm(file.pixel_pitch_um),
            centre_px=file.centre_px,
        )

    def at(self, places_px: FloatGrid) -> FloatGrid:
        """Return the light (...) at places (..., 2) of a picture."""
        if self.light is None:
            return np.ones(places_px.shape[:-1])
        radius_mm = self.pitch_mm * np.hypot(*np.moveaxis(places_px - self.centre_px, -1, 0))
        return np.asarray(np.interp(radius_mm**2, self.light.heights_mm**2, self.light.light))
