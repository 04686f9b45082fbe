"""Pictures of an uneven display through a lens that vignettes, at stated poses."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.calibration.flat.pose import Pose
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import write_bayer_dng
from tests.dng_factory import grey_tags

BLACK, WHITE = 256, 4095
ELECTRONS_AT_WHITE = 10_000
FloatGrid = NDArray[np.float64]
Shift = tuple[float, float, float]
"""X and y in widths of the picture, and degrees."""
GOOD: Sequence[Shift] = ((0, 0, 0), (0.33, 0, 0), (0, 0.33, 0), (0, 0, 90))


@dataclass(frozen=True, slots=True, kw_only=True)
class Flats:
    """A lens and a display.

    The lens falls off as the fourth power of a cosine, with a rim that cuts into the corner; the
    display is darker at its border, brighter on one side, and has waves of 3 %.
    """

    width: int = 360
    height: int = 240
    centre: tuple[float, float] = (0.0, 0.0)  # of half the diagonal
    level: float = 0.6

    @property
    def radius_px(self) -> float:
        """Give half the diagonal."""
        return math.hypot(self.width, self.height) / 2

    def lens(self, radius: FloatGrid) -> FloatGrid:
        """Give relative illumination at a radius, 1 half the diagonal."""
        rim = (1 + math.exp(-1.15 / 0.08)) / (1 + np.exp((radius - 1.15) / 0.08))
        return np.asarray((1 + (0.55 * radius) ** 2) ** -2 * rim)

    def display(self, x: FloatGrid, y: FloatGrid) -> FloatGrid:
        """Give the display's light at places from its middle."""
        waves = 0.03 * np.cos(2.5 * x + 1) * np.sin(3 * y)
        return np.asarray(1 + 0.10 * x - 0.06 * y - 0.12 * (x**2 + 0.7 * y**2) + waves)

    def pose(self, shift: Shift) -> Pose:
        """Give a pose in pixels."""
        x, y, turn_deg = shift
        return Pose(shift_px=(x * self.width, y * self.width), turn_rad=math.radians(turn_deg))

    def seen(self, shift: Shift) -> FloatGrid:
        """Give the (h, w) light of a picture, 1 at white."""
        y, x = np.mgrid[: self.height, : self.width].astype(np.float64)
        x, y = x - (self.width - 1) / 2, y - (self.height - 1) / 2
        at = self.pose(shift).places(x, y)
        radius = np.hypot(x / self.radius_px - self.centre[0], y / self.radius_px - self.centre[1])
        display = self.display(*(place / self.radius_px for place in at))
        return np.asarray(self.level * self.lens(radius) * display)

    def write(self, folder: Path, shifts: Sequence[Shift] = GOOD, orientations: Sequence[int] = (), description: str = "") -> list[Path]:  # noqa: E501 # fmt: skip
        """Write DNGs of 12 bits, each with its exposure."""
        rng = np.random.default_rng(3)
        paths = [folder / f"{n}.dng" for n in range(len(shifts))]
        for n, (path, shift) in enumerate(zip(paths, shifts, strict=True)):
            light = self.seen(shift) * (1 + 0.1 * rng.uniform(-1, 1))
            noise = rng.standard_normal(light.shape) * np.sqrt(light / ELECTRONS_AT_WHITE)
            codes = np.rint(BLACK + (light + noise) * (WHITE - BLACK))
            tags = grey_tags(
                metadata=Metadata(),
                description=description,
                orientation=orientations[n] if orientations else 1,
            )
            write_bayer_dng(path, np.clip(codes, 0, WHITE).astype(np.uint16), tags=tags)
        return paths

    def write_planes(self, folder: Path, shifts: Sequence[Shift]) -> list[Path]:
        """Write linear PNGs of 16 bits."""
        paths = [folder / f"{n}.png" for n in range(len(shifts))]
        for path, shift in zip(paths, shifts, strict=True):
            codes = np.clip(np.rint(65535 * self.seen(shift)), 0, 65535).astype(np.uint16)
            assert cv2.imwrite(str(path), np.stack([codes // 2, codes, codes // 3], axis=-1))
        return paths

    def said(self, shifts: Sequence[Shift]) -> tuple[list[str], list[float]]:
        """Give what a person says of the poses."""
        poses = [self.pose(shift) for shift in shifts]
        return [f"{p.shift_px[0]:g},{p.shift_px[1]:g}" for p in poses], [
            turn for *_, turn in shifts
        ]
