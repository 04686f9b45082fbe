"""Optics with streaks, and captures behind them, for the tests of `kinds.hdr.streaks`."""

import math
from dataclasses import replace

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern, cfa_channels
from camkit.runtime.kinds.hdr.streaks.cells import COLOURS, Cells, cells_of, sample_sites
from camkit.runtime.kinds.hdr.streaks.kernels import StreakKernels, streak_kernels
from camkit.runtime.kinds.hdr.streaks.recovery import Recovery, Region
from camkit.runtime.kinds.hdr.streaks.regions import Window
from camkit.streaks import StreakOptics
from tests.hdr_bundle import LAST_PX, four_lines

Mask = NDArray[np.bool_]


def small_streaks(*, pitch_um: float = 6.0) -> StreakOptics:
    """Give random parts: two depths, two wavelengths, three arms of different reach."""
    rng = np.random.default_rng(7)
    lead, arms = (2, 2), 3
    core = rng.uniform(0.5, 1, (*lead, 5, 5))
    profiles = rng.uniform(0.2, 1, (*lead, arms, 11))
    profiles[..., 0, 8:] = 0
    section = np.array([0.0, 0.5, 1, 2, 1, 0.5, 0.0]) + rng.uniform(0, 0.1, (2, arms, 7))
    return StreakOptics(
        core=(0.9 * core / core.sum((-2, -1), keepdims=True)).astype(np.float32),
        bare_core=(core / core.sum((-2, -1), keepdims=True)).astype(np.float32),
        profiles=(2e-3 * profiles).astype(np.float32),
        sections=(section / section.sum(-1, keepdims=True) * 4).astype(np.float32),
        angles_rad=np.array([0.3, 2.0, -1.2]),
        haze=rng.uniform(1e-6, 1e-5, (*lead, 3, 3)).astype(np.float32),
        depths_mm=np.array([1000.0, math.inf]),
        wavelengths_um=np.array([0.5, 0.6]),
        pixel_pitch_um=pitch_um,
    )


def star() -> FloatArray:
    """Give the dense kernels (3, n, n) of four lines, each of sum 1."""
    kernels = four_lines().dense()[0]
    return np.asarray(kernels / kernels.sum((-2, -1), keepdims=True), np.float32)


def star_kernels(cfa: CfaPattern | None = "RGGB") -> StreakKernels:
    """Give the kernels of cells of four lines."""
    return streak_kernels(star(), sample_sites(cfa), LAST_PX + 1)


def blurred(scene: FloatArray, kernels: FloatArray) -> FloatArray:
    """Spread the light of a scene (3, h, w) that goes on beyond its border as it ends there."""
    half = kernels.shape[-1] // 2
    wide = np.pad(scene, ((0, 0), (half, half), (half, half)), mode="edge").astype(np.float64)
    planes = [
        scipy.signal.fftconvolve(plane, kernel, mode="valid")
        for plane, kernel in zip(wide, kernels.astype(np.float64), strict=True)
    ]
    return np.asarray(planes, np.float32)


def sampled(planes: FloatArray, cfa: CfaPattern | None) -> FloatArray:
    """Give (1, h, w) of a mosaic, or the planes themselves without a pattern."""
    if cfa is None:
        return planes
    y, x = np.indices(planes.shape[1:])
    letters = np.array(cfa_channels(cfa))[y % 2, x % 2]
    return np.take_along_axis(planes, letters[None], 0)


def captured(light: FloatArray, cfa: CfaPattern | None) -> tuple[FloatArray, Mask]:
    """Record light (3, h, w) in 12 bits: samples, 1.0 where they clip, and where that is."""
    samples = np.minimum(np.rint(sampled(light, cfa) * 4095) / 4095, 1).astype(np.float32)
    return samples, samples >= 1


def captured_cells(light: FloatArray, cfa: CfaPattern | None = "RGGB") -> Cells:
    """Record light and give its cells."""
    return cells_of(*captured(light, cfa), sample_sites(cfa))


def street(height: int, width: int, seed: int = 0) -> FloatArray:
    """Give a textured scene (3, h, w) without lamps, values within 0.02..0.4."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width]
    planes = np.full((3, height, width), 0.12)
    for _ in range(12):
        angle, size = rng.uniform(0, math.pi), rng.uniform(0.02, 0.3)
        wave = np.sin(size * (x * np.cos(angle) + y * np.sin(angle)) + rng.uniform(0, 6))
        planes += 0.02 * wave * rng.uniform(0.5, 1, (3, 1, 1))
    planes[:, y > 0.7 * height] *= 1.8  # a kerb
    planes[:, :, 10:20] *= 0.4  # a post
    return np.clip(planes, 0.02, 0.4).astype(np.float32)


def with_lamps(
    scene: FloatArray, lamps: list[tuple[int, int, float, tuple[float, float, float]]]
) -> FloatArray:
    """Put discs into a scene, each (y, x, radius, light of the colours)."""
    lit = scene.copy()
    y, x = np.indices(scene.shape[1:])
    for at_y, at_x, radius, light in lamps:
        lit[:, np.hypot(y - at_y, x - at_x) <= radius] = np.array(light, np.float32)[:, None]
    return lit


def one_light(
    clipped: FloatArray, offset_px: tuple[float, float], pixels: NDArray[np.uint8] | None = None
) -> Recovery:
    """Give a recovery of one window with a light of 9 in every clipped cell, and no streaks.

    Args:
        clipped: (3, h, w) share of the samples.
        offset_px: Of the cells, for every colour.
        pixels: As in `Cells`; else all samples of every cell with a clipped one.
    """
    every = np.where(clipped > 0, 15, 0).astype(np.uint8)
    cells = Cells(
        light=np.zeros_like(clipped),
        clipped=clipped,
        pitch_px=2,
        offset_px=(offset_px,) * COLOURS,
        pixels=every if pixels is None else pixels,
    )
    _, height, width = clipped.shape
    region = Region(
        window=Window(top=0, bottom=height, left=0, right=width),
        light=9 * (clipped > 0).astype(np.float32),
        streaks=np.zeros_like(clipped),
        streak_sums=(0, 0, 0),
    )
    return Recovery(
        fine=cells,
        coarse=replace(cells, pitch_px=4),
        veil=np.zeros((COLOURS, height // 2, width // 2), np.float32),
        core=(1.0,) * COLOURS,
        kernels=(np.zeros((1, 1), np.float32),) * COLOURS,
        regions=(region,),
    )
