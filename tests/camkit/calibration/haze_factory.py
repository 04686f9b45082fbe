"""A point, a disc or an edge through optics with much haze: captures, and what is true of them."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import fft, special

from tests.camkit.calibration.point_factory import (
    BLACK,
    WHITE,
    exposed,
    mosaic_of,
    write_mosaic,
)

FloatGrid = NDArray[np.float64]
TIMES_S = (1.0, 1 / 8, 1 / 64)
DARKS = 4


@dataclass(frozen=True)
class Hazy:
    """A Gaussian core and haze that falls as the third power of the radius and ends at `end`.

    `core` of the light lies in the core. `drift_dn` is by how much the black of frames differs.
    """

    core: float = 0.14
    scale: float = 100.0
    end: float = 250.0
    side: int = 600
    x: float = 301.3
    y: float = 297.6
    spreads_px: tuple[float, float, float] = (1.6, 1.4, 1.3)
    drift_dn: float = 0.03
    seed: int = 0

    def haze(self, radius: FloatGrid) -> FloatGrid:
        fall = (1 + (radius / self.scale) ** 2) ** -1.5
        return fall / (1 + np.exp((radius - self.end + 20) / 4))

    @cached_property
    def haze_light(self) -> float:
        radius = np.arange(0, 1.5 * self.end, 0.05)
        return float((2 * np.pi * radius * self.haze(radius)).sum() * 0.05)

    def kernel(self, colour: int, radius: FloatGrid) -> FloatGrid:
        """Give the light of a colour (0 red) per pixel, of all."""
        square = self.spreads_px[colour] ** 2
        core = np.exp(-(radius**2) / (2 * square)) / (2 * np.pi * square)
        return self.core * core + (1 - self.core) * self.haze(radius) / self.haze_light

    @cached_property
    def peak_share(self) -> float:
        """What lies within 10 px of the peak, of green; pixels count whole."""
        y, x = np.mgrid[-400:401, -400:401].astype(np.float64)
        kernel = self.kernel(1, np.hypot(y, x))
        return float(kernel[np.hypot(y, x) <= 10].sum() / kernel.sum())

    def planes(self, disc_px: float = 0.0) -> FloatGrid:
        """Give (3, side, side) light of a point or of a disc, 1 at its brightest."""
        y, x = np.indices((self.side, self.side))
        radius = np.hypot(y - self.y, x - self.x)
        planes = np.stack([self.kernel(c, radius) for c in range(3)])
        if disc_px:
            wide = np.pad(planes, ((0, 0), (20, 20), (20, 20)), mode="edge")
            n = wide.shape[-1]
            at = np.pi * disc_px * np.hypot(fft.fftfreq(n)[:, None], fft.rfftfreq(n)[None])
            disc = np.where(at > 0, 2 * special.j1(at) / np.where(at > 0, at, 1), 1)
            planes = fft.irfft2(fft.rfft2(wide) * disc, s=(n, n))[:, 20:-20, 20:-20]
        return planes / planes.max()

    def edge_planes(self, angle_rad: float) -> FloatGrid:
        """Give (3, side, side) light of an edge through (x, y), bright at larger x; 1 far inside.

        The bright side goes on beyond the frame.
        """
        y, x = np.indices((self.side, self.side))
        distance = (x - self.x) * np.cos(angle_rad) - (y - self.y) * np.sin(angle_rad)
        fine = np.arange(-1.5 * self.end, 1.5 * self.end, 0.25)
        line = np.array([2 * self.haze(np.hypot(fine, d)).sum() for d in np.arange(0, 1.5 * self.end, 0.25)])  # noqa: E501 # fmt: skip
        line /= 2 * line.sum() - line[0]
        rise = 0.5 + np.cumsum(line) - line[0] / 2 - line / 2
        places = np.arange(line.size) * 0.25
        haze = 0.5 + np.sign(distance) * (np.interp(np.abs(distance), places, rise) - 0.5)
        return np.stack(
            [
                self.core * special.ndtr(distance / spread) + (1 - self.core) * haze
                for spread in self.spreads_px
            ]
        )

    def write(
        self,
        folder: Path,
        planes: FloatGrid,
        peak: float = 0.7,
        times_s: tuple[float, ...] = TIMES_S,
    ) -> list[Path]:
        """Write a bracket of DNGs, longest first; `peak` is that of the shortest, in white."""
        light, rng = mosaic_of(planes), np.random.default_rng(100 + self.seed)
        paths = [folder / f"light-{n}.dng" for n in range(len(times_s))]
        for n, (path, time_s) in enumerate(zip(paths, times_s, strict=True)):
            seen = exposed(light, peak * time_s / times_s[-1], 10 * self.seed + n)
            write_mosaic(path, seen + self._drifted(rng), time_s)
        return paths

    def write_darks(self, folder: Path, count: int = DARKS, time_s: float = 1.0) -> list[Path]:
        """Write frames without light."""
        rng = np.random.default_rng(200 + self.seed)
        paths = [folder / f"dark-{n}.dng" for n in range(count)]
        for n, path in enumerate(paths):
            seen = exposed(np.zeros((self.side, self.side)), 1.0, 500 + 10 * self.seed + n)
            write_mosaic(path, seen + self._drifted(rng), time_s)
        return paths

    def _drifted(self, rng: np.random.Generator) -> float:
        return self.drift_dn / (WHITE - BLACK) * rng.standard_normal()
