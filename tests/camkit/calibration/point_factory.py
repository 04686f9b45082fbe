"""Brackets of a point light behind a known kernel: a core, faint streaks, a fraction of a pixel."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.cfa import cfa_channels
from camkit.noise import NoiseModel
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import write_bayer_dng
from tests.dng_factory import grey_tags

BLACK, WHITE = 256, 4095
NOISE = NoiseModel(shot=(1e-4,) * 3, read_variance=(1e-6,) * 3)
TIMES_S = tuple(8.0**-n for n in range(5))  # 3 EV apart
STREAK = 1e-5
FloatGrid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A point light as a lens throws it on a sensor of `side` pixels, at (x, y).

    Its streaks lie at 0, 45, 90 and 135 degrees, `STREAK` of the peak, and end at `reach` px.
    """

    side: int = 260
    x: float = 131.3
    y: float = 127.6
    reach: float = 90.0
    spreads_px: tuple[float, float, float] = (1.5, 1.4, 1.3)
    streak: float = STREAK

    def kernel(self, colour: int, dy: FloatGrid, dx: FloatGrid) -> FloatGrid:
        """Give values of a colour (0 red) at offsets from the centre, 1 at the peak."""
        core = np.exp(-0.5 * (dy**2 + dx**2) / self.spreads_px[colour] ** 2)
        found = core + 1e-3 * np.exp(-0.5 * (dy**2 + dx**2) / 6.0**2)
        for angle in np.deg2rad([0, 45, 90, 135]):
            along = np.cos(angle) * dx + np.sin(angle) * dy
            across = np.cos(angle) * dy - np.sin(angle) * dx
            end = 1 / (1 + np.exp((np.abs(along) - self.reach) / 2))
            found += self.streak * np.exp(-0.5 * (across / 1.8) ** 2) * end
        return np.asarray(found)

    def kernels(self, half: int) -> FloatGrid:
        """Give what a measurement should: blue, green, red, each of sum 1."""
        dy, dx = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
        found = np.stack([self.kernel(c, dy, dx) for c in (2, 1, 0)])
        return np.asarray(found / found.sum((-2, -1), keepdims=True))

    def planes(self) -> FloatGrid:
        """Give (3, side, side) light, 1 at the peak."""
        y, x = np.indices((self.side, self.side))
        return np.stack([self.kernel(c, y - self.y, x - self.x) for c in range(3)])


def exposed(light: FloatGrid, exposure: float, seed: int, dark: FloatGrid | None = None):  # type: ignore[no-untyped-def]
    """Give light with noise and without bound, 1 at white."""
    rng = np.random.default_rng(seed)
    lit = light * exposure + (0 if dark is None else dark)
    variance = NOISE.shot[0] * np.maximum(lit, 0) + NOISE.read_variance[0]
    return lit + rng.normal(size=lit.shape) * np.sqrt(variance)


def mosaic_of(planes: FloatGrid) -> FloatGrid:
    """Give the (h, w) mosaic RGGB of (3, h, w) planes."""
    found = np.empty(planes.shape[1:])
    for dy, row in enumerate(cfa_channels("RGGB")):
        for dx, colour in enumerate(row):
            found[dy::2, dx::2] = planes[colour, dy::2, dx::2]
    return found


def write_mosaic(path: Path, seen: FloatGrid, time_s: float) -> None:
    """Write a 12-bit mosaic as DNG that states its time."""
    codes = np.clip(np.rint(BLACK + seen * (WHITE - BLACK)), 0, WHITE).astype(np.uint16)
    tags = grey_tags(metadata=Metadata.believable(exposure_time_s=time_s), noise=NOISE)
    write_bayer_dng(path, codes, tags=tags)


def write_bracket(
    folder: Path,
    point: Point,
    *,
    peak: float = 0.7,
    dark: FloatGrid | None = None,
    times_s: tuple[float, ...] = TIMES_S,
) -> list[Path]:
    """Write DNGs, longest first; `peak` is that of the shortest frame, in white."""
    light = mosaic_of(point.planes())
    paths = [folder / f"{n}.dng" for n in range(len(times_s))]
    for n, (path, time_s) in enumerate(zip(paths, times_s, strict=True)):
        here = None if dark is None else dark * time_s
        seen = exposed(light, peak * time_s / times_s[-1], n, here)
        write_mosaic(path, seen, time_s)
    return paths


def write_pictures(
    folder: Path, point: Point, *, peak: float = 0.7, times_s: tuple[float, ...] = TIMES_S
) -> list[Path]:
    """Write linear PNGs of 16 bits, longest first."""
    return write_planes(folder, point.planes(), peak=peak, times_s=times_s)


def write_planes(
    folder: Path, planes: FloatGrid, *, peak: float = 0.7, times_s: tuple[float, ...] = TIMES_S
) -> list[Path]:
    """Write (3, h, w) light, 1 at the peak, as linear PNGs of 16 bits, longest first."""
    paths = [folder / f"{n}.png" for n in range(len(times_s))]
    for n, (path, time_s) in enumerate(zip(paths, times_s, strict=True)):
        seen = exposed(planes, peak * time_s / times_s[-1], n)
        codes = np.clip(np.rint(seen * 65535), 0, 65535).astype(np.uint16)
        assert cv2.imwrite(str(path), codes[::-1].transpose(1, 2, 0))
    return paths
