"""A coded capture whose truth is known: lamps, a plate with two peaks, a camera of 8 bits."""

from functools import lru_cache
from pathlib import Path
from typing import Final

import cv2
import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from tools.hdr.coded_optics import seen_through

SIDE_PX: Final = 160
PSF_PX: Final = 61
OFFSET: Final = 0.5
GREEN_END: Final = 231
STOPS: Final = {
    "3.00": 3.02,
    "2.00": 2.0,
    "1.00": 1.04,
    "0.00": 0.0,
    "-1.00": -0.97,
    "-2.00": -2.03,
    "-3.32": -3.33,
    "-5.00": -5.0,
}
"""As stated in names, and as exposed."""
SHIFT_PX: Final = (2, -3)
GAIN: Final = 0.9


def dual_peak() -> FloatArray:
    """Give a core of 85 %, peaks of 8 and 5 % and some haze, the same in all colours."""
    y, x = np.mgrid[-(PSF_PX // 2) : PSF_PX // 2 + 1, -(PSF_PX // 2) : PSF_PX // 2 + 1]

    def blob(down: float, right: float, spread_px: float) -> NDArray[np.float64]:
        light = np.exp(-((y - down) ** 2 + (x - right) ** 2) / (2 * spread_px**2))
        return np.asarray(light / light.sum())

    one = 0.85 * blob(0, 0, 1.2) + 0.08 * blob(17, -14, 2) + 0.05 * blob(-20, 9, 2)
    one += 0.02 * blob(0, 0, 9)
    return np.stack([one / one.sum()] * 3).astype(np.float32)


def write_scene(folder: Path) -> None:
    """Write capture and bracket into a folder, and the PSF beside it."""
    folder.mkdir(parents=True)
    psf = dual_peak()
    _write(folder / "wPSF_0_stop.png", seen_through(laid_light(), psf))
    for name, stops in STOPS.items():
        _write(folder / f"woutPSF_{name}_stop.png", true_light() * np.float32(2.0**stops))
    stated = psf.transpose(1, 2, 0)[:, :, None].astype(np.float64)
    np.savez(folder.parent / "MeasuredPSF.npz", psf_val=stated)


@lru_cache
def true_light() -> FloatArray:
    """Give the light without plate: two lamps in the dark."""
    rng = np.random.default_rng(3)
    field = scipy.ndimage.gaussian_filter(rng.normal(size=(SIDE_PX, SIDE_PX)), 5)
    ground = 0.12 + 0.08 * field / np.abs(field).max()
    y, x = np.mgrid[:SIDE_PX, :SIDE_PX]
    for row, column, radius, light in ((80, 90, 7, 12), (50, 60, 2, 10)):
        ground[np.hypot(y - row, x - column) <= radius] = light
    colours = np.array([1.0, 0.85, 0.95])[:, None, None]
    lit = scipy.ndimage.gaussian_filter(ground, 0.8)[None] * colours
    return np.asarray(lit, np.float32)


def laid_light() -> FloatArray:
    """Give the light that the plate sees: moved, and less."""
    return np.asarray(np.roll(true_light(), SHIFT_PX, (1, 2)) * np.float32(GAIN))


def codes_of(light: FloatArray, *, mixed: bool = True) -> NDArray[np.uint8]:
    """Give 8 bits; where mixed, green ends at a code of its own where the others are full."""
    codes = np.clip(np.rint(light * (255 + OFFSET) - OFFSET), 0, 255)
    if mixed:
        full = (codes[0] == 255) & (codes[2] == 255)
        codes[1] = np.where(full, np.minimum(codes[1], GREEN_END), codes[1])
    return codes.astype(np.uint8)


def _write(path: Path, light: FloatArray) -> None:
    assert cv2.imwrite(str(path), codes_of(light).transpose(1, 2, 0)[..., ::-1])
