"""Captures of a screen: a known homography, a lens that distorts and vignettes, blur, a mosaic."""

from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.calibration.geometry.camera_model import MODELS, Camera, project
from camkit.calibration.record import to_toml
from camkit.cfa import cfa_channels
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import DngTags, write_bayer_dng

FloatGrid = NDArray[np.float64]
BLACK, WHITE = 256, 4095
ELECTRONS_AT_WHITE = 10_000
GAMMA, DARK = 2.3, 0.002
COLOURS = np.array([[0.42, 0.11, 0.03], [0.16, 0.66, 0.09], [0.02, 0.14, 0.55]])
"""Of the display, columns red, green, blue, as the sensor sees them."""
COLOR_MATRIX = np.array(
    [[0.664, -0.1847, -0.0503], [-0.5238, 1.301, 0.2474], [-0.0993, 0.1673, 0.6527]]
)
FINE = 2


def luminance(levels):
    """Give the light of a display at levels 0..255, 1 at the brightest."""
    return DARK + (1 - DARK) * (np.asarray(levels) / 255) ** GAMMA


def camera_of(size, k1=-0.12, k2=0.02):
    """Give a camera of barrel distortion, its centre off the middle."""
    width, height = size
    intrinsics = np.array([1.1 * width, width / 2 + 4.0, height / 2 - 3.0, k1, k2])
    return Camera(model=next(m for m in MODELS if m.name == "radial_2"), intrinsics=intrinsics)


def homography_of(screen, size, *, fill=0.86, turn_deg=2.0, tilt=0.06):
    """Give (3, 3) screen px -> px of a capture without distortion."""
    width, height = screen
    turn = np.radians(turn_deg)
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) * [width, height]
    rotated = corners @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    upright = np.ptp(corners, axis=0) if abs(np.sin(turn)) < 0.5 else np.ptp(corners, axis=0)[::-1]
    scale = fill * float((np.array(size) / upright).min())
    far = 1 + tilt * np.array([-1, 1, 1, -1]) + 0.5 * tilt * np.array([-1, -1, 1, 1])
    seen = rotated * scale * far[:, None] + (np.array(size) - 1) / 2
    source = corners + (np.array([width, height]) - 1) / 2
    matrix = cv2.getPerspectiveTransform(source.astype(np.float32), seen.astype(np.float32))
    return np.asarray(matrix, dtype=np.float64)


def ideal_places(camera, x, y):
    """Give where pixels lie without distortion, by iteration."""
    seen = np.stack([x, y], axis=-1).reshape(-1, 2)
    centre = np.array(camera.centre_px)
    wanted = (seen - centre) / camera.focal_px
    k1, k2 = camera.coefficients[:2]
    at = wanted
    for _ in range(15):
        square = (at**2).sum(axis=-1, keepdims=True)
        at = wanted / (1 + square * (k1 + square * k2))
    return (at * camera.focal_px + centre).reshape(*x.shape, 2)


@dataclass(frozen=True, kw_only=True)
class Booth:
    """A camera before a screen."""

    screen: tuple[int, int]
    size: tuple[int, int] = (600, 400)
    blur_px: float = 1.0
    veil: float = 0.0  # light that lies over everything: a half leaves a contrast of a third
    level: float = 0.8
    corner: float = 0.6  # relative illumination in the corner
    turn_deg: float = 2.0
    noisy: bool = True
    lens: tuple[float, float] = (-0.12, 0.02)
    cache: dict = field(default_factory=dict, repr=False)

    @property
    def camera(self):
        return camera_of(self.size, *self.lens)

    @property
    def homography(self):
        return homography_of(self.screen, self.size, turn_deg=self.turn_deg)

    def places(self):
        """Give (h * FINE, w * FINE, 2) places on the screen of parts of pixels."""
        if "places" not in self.cache:
            width, height = self.size
            y, x = np.mgrid[: height * FINE, : width * FINE]
            x, y = ((v + 0.5) / FINE - 0.5 for v in (x, y))
            ideal = ideal_places(self.camera, x, y).reshape(-1, 2)
            at = np.column_stack([ideal, np.ones(len(ideal))]) @ np.linalg.inv(self.homography).T
            self.cache["places"] = (at[:, :2] / at[:, 2:]).reshape(*x.shape, 2).astype(np.float32)
        return self.cache["places"]

    def seen_at(self, screen_px):
        """Give (n, 2) places in the capture of places on the screen."""
        at = np.column_stack([screen_px, np.ones(len(screen_px))]) @ self.homography.T
        ideal = at[:, :2] / at[:, 2:]
        points = (ideal - self.camera.centre_px) / self.camera.focal_px
        points = np.column_stack([points, np.ones(len(points))])
        return project(self.camera, np.zeros(6), points)[0]

    def vignetting(self):
        """Give the (h, w) relative illumination, 1 in the optical centre."""
        y, x = np.mgrid[: self.size[1], : self.size[0]]
        centre = self.camera.centre_px
        radius = np.hypot(x - centre[0], y - centre[1]) / (np.hypot(*self.size) / 2)
        return 1 - (1 - self.corner) * radius**2

    def planes(self, codes):
        """Give (3, h, w) light of the sensor's colours, 1 at white."""
        shown = luminance(codes.astype(np.float64)).transpose(2, 0, 1).astype(np.float32)
        at = self.places()
        fine = [
            cv2.remap(p, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderValue=0.0) for p in shown
        ]
        seen = [cv2.resize(p, self.size, interpolation=cv2.INTER_AREA) for p in fine]
        seen = np.stack([cv2.GaussianBlur(p, (0, 0), self.blur_px) for p in seen])
        light = np.tensordot(COLOURS, seen, 1)
        white = COLOURS.sum(axis=1)[:, None, None]
        return self.level * self.vignetting() * (self.veil * white + (1 - self.veil) * light)

    def write(self, path: Path, codes, *, iso=100.0, seed=1, exposure=1.0) -> Path:
        """Write what the camera takes of a screen, as a DNG of 12 bits."""
        planes = self.planes(codes) * exposure
        channels = np.array(cfa_channels("RGGB"))
        mosaic = np.empty(planes.shape[1:])
        for dy in (0, 1):
            for dx in (0, 1):
                mosaic[dy::2, dx::2] = planes[channels[dy, dx], dy::2, dx::2]
        rng = np.random.default_rng(seed)
        if self.noisy:
            mosaic += rng.standard_normal(mosaic.shape) * np.sqrt(
                np.maximum(mosaic, 0) / ELECTRONS_AT_WHITE + 1e-7
            )
        counts = np.clip(np.rint(BLACK + mosaic * (WHITE - BLACK)), 0, WHITE).astype(np.uint16)
        tags = DngTags(
            cfa="RGGB",
            black=BLACK,
            white=WHITE,
            color_matrix=COLOR_MATRIX,
            as_shot_neutral=(0.5, 1.0, 0.625),
            camera_model="camkit test",
            metadata=Metadata(iso=iso, exposure_time_s=0.02 * exposure),
            description="",
        )
        write_bayer_dng(path, counts, tags=tags)
        return path

    def write_geometry(self, path: Path) -> Path:
        """Write what `camkit calibrate geometry` would."""
        camera = self.camera
        record = {
            "width_px": self.size[0],
            "height_px": self.size[1],
            "model": camera.model.name,
            "focal_px": camera.focal_px,
            "centre_px": list(camera.centre_px),
            "coefficients": camera.coefficients.tolist(),
            "covered_radius_px": float(np.hypot(*self.size)),
            # of bundles; pairs take the model
            "radial": {"coefficients": [1.0, 0.0, 0.0, 0.0], "radius_px": 1.0, "residual_px": 0.0},
        }
        path.write_text(to_toml(record), encoding="utf-8")
        return path

    def write_tone(self, path: Path) -> Path:
        """Write what `camkit calibrate tone` would."""
        levels = np.linspace(0, 255, 18)
        record = {"levels": levels.tolist(), "luminance": luminance(levels).tolist()}
        path.write_text(to_toml(record), encoding="utf-8")
        return path
