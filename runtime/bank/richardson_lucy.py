"""Richardson-Lucy on one periodic block: positive, at ease with highlights and missing samples."""

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.noise import NoiseModel
from camkit.runtime.bank.spectrum import apply_transfer

CLIPPED_REACH_PX = 2
"""How far the demosaic spreads a clipped sample."""

START_SHARE = 0.1
"""The start lies at this share of the mean at least: what starts at zero stays there."""

LEAST_SIGNAL = 1e-6


def richardson_lucy(
    samples: FloatArray,
    otf: NDArray[np.complex64],
    background: FloatArray,
    iterations: int,
    clipped: NDArray[np.bool_] | None = None,
    *,
    power: float = 1.0,
) -> FloatArray:
    """Sharpen by Richardson-Lucy for Poisson noise, read noise taken as a known background.

    Args:
        samples: (c, b, b) float32, taken as periodic; negatives count as no light.
        otf: (c, b, b // 2 + 1) complex64.
        background: (c, 1, 1), read_variance / shot.
        iterations: Rounds; each sharpens and raises noise.
        clipped: (1 or c, b, b), samples known to be at least as bright as they read.
        power: Of every round's correction, 1 <= power < 3; more goes further in a round.

    Returns:
        (c, b, b) float32 >= 0.

    References: Richardson 1972; Lucy 1974; Snyder et al. 1993 (background); Meinel 1986 (power).
    """
    measured = np.maximum(samples + background, np.float32(LEAST_SIGNAL))
    back = np.conj(otf)
    floor = START_SHARE * samples.mean(axis=(-2, -1), keepdims=True, dtype=np.float64)
    sharp = np.maximum(samples, np.maximum(floor, LEAST_SIGNAL).astype(np.float32))
    for _ in range(iterations):
        expected = np.maximum(apply_transfer(sharp, otf), 0) + background
        ratio = measured / np.maximum(expected, np.float32(LEAST_SIGNAL))
        if clipped is not None:
            np.maximum(ratio, 1, out=ratio, where=clipped)
        step = np.maximum(apply_transfer(ratio, back), 0)
        if power != 1:
            step **= power
        sharp = sharp * step
    return np.asarray(sharp)


def background_of(noise: NoiseModel) -> FloatArray:
    """Return read_variance / shot as (c, 1, 1): the light that would make the read noise."""
    shot = np.maximum(np.array(noise.shot), 1e-12)
    return np.asarray(np.array(noise.read_variance) / shot, dtype=np.float32)[:, None, None]


def spread_clipped(saturated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Widen a (c, h, w) mask of clipped samples to all that the demosaic made of them."""
    side = 2 * CLIPPED_REACH_PX + 1
    square = np.ones((side, side), dtype=np.uint8)
    wide = [cv2.dilate(np.ascontiguousarray(mask, np.uint8), square) for mask in saturated]
    return np.asarray(np.stack(wide), dtype=np.bool_)
