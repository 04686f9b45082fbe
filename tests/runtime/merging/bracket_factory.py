"""Brackets of a known scene: mosaics as DNG, linear pictures, pictures behind a curve."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import encode_srgb
from camkit.noise import NoiseModel
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import write_bayer_dng
from tests.dng_factory import grey_tags

BLACK, WHITE = 256, 4095
NOISE = NoiseModel(shot=(1e-4,) * 3, read_variance=(1e-6,) * 3)
TIMES_S = (1.0, 1 / 8, 1 / 64)


def write_dng(
    path: Path,
    light: FloatArray,
    time_s: float | None,
    *,
    seed: int = 0,
    iso: float | None = None,
    noise: NoiseModel | None = NOISE,
) -> None:
    """Expose a (h, w) mosaic of light per second, with noise and 12 bits, RGGB."""
    x = light * (1.0 if time_s is None else time_s)
    rng = np.random.default_rng(seed)
    seen = x + rng.normal(size=x.shape) * np.sqrt(NOISE.shot[0] * x + NOISE.read_variance[0])
    codes = np.clip(np.rint(BLACK + seen * (WHITE - BLACK)), 0, WHITE).astype(np.uint16)
    write_bayer_dng(
        path,
        codes,
        tags=grey_tags(
            metadata=Metadata.believable(exposure_time_s=time_s, iso=iso),
            noise=noise,
        ),
    )


def write_coded(
    path: Path, light: FloatArray, curve: NDArray[np.float64] | None = None, *, seed: int = 0
) -> None:
    """Write (3, h, w) light as 8 bits behind sRGB, or behind a curve: the light of each code."""
    rng = np.random.default_rng(seed)
    if curve is None:
        codes = encode_srgb(light).astype(np.float64) * 255
    else:
        codes = np.interp(light, curve, np.arange(256))
    noisy = np.clip(np.rint(codes + rng.normal(0, 0.3, codes.shape)), 0, 255).astype(np.uint8)
    assert cv2.imwrite(str(path), noisy[::-1].transpose(1, 2, 0))


def scene(height: int = 48, width: int = 64, *, stops: float = 12.0, seed: int = 3) -> FloatArray:
    """Give (3, h, w) light per second: smooth, `stops` between its ends, brightest 24."""
    rng = np.random.default_rng(seed)
    small = rng.random((3, 5, 6)).astype(np.float32)
    wide = np.stack([cv2.resize(p, (width, height), interpolation=cv2.INTER_CUBIC) for p in small])
    wide = (wide - wide.min()) / np.ptp(wide)
    return (24 * 2.0 ** (stops * (wide - 1))).astype(np.float32)
