"""The signal-to-noise ratio of measured light, and smoothing where a PSF holds only noise.

A PSF may not be negative, and noise clipped at zero adds light that does not exist: a thousandth of
the peak's noise over a hundred thousand pixels is as much as a streak. So where neighbours scatter
by no more than the noise, their mean replaces all of them.

References: Lee 1980, "Digital image enhancement and noise filtering by use of local statistics".
"""

from typing import Final

import numpy as np
from scipy import ndimage

from camkit.calibration.lattice import FloatGrid

BOX_PX: Final = 7
SPREADS: Final = 6.0
"""A mean over a box that lies this many of its spreads above zero is light."""
GAP_PX: Final = 12
"""Rings without light after which there is taken to be none farther out."""
MARGIN_PX: Final = 2
LEAST_HALF_PX: Final = 7
OUTER_SHARE: Final = 0.8
_LOW_PAIR: Final = (0.05, 0.25)
_LOW_PAIR_SPREADS: Final = 0.9704  # of a normal distribution, between these quantiles


def reach_px(light: FloatGrid, noise: FloatGrid) -> int:
    """Return the distance from the middle, along rows or columns, up to which there is light.

    Args:
        light: (colour, side, side), background taken off.
        noise: Its standard deviation per sample.
    """
    half = light.shape[-1] // 2
    rings = _rings(light.shape[-1])
    lit = np.zeros(half + 1, dtype=bool)
    for plane, spread in zip(light, noise, strict=True):
        mean = ndimage.uniform_filter(plane / spread, BOX_PX)
        # samples between those of a lattice are no independent ones: the scatter tells how many;
        # it is taken where there is least light
        low, high = np.quantile(mean[rings >= OUTER_SHARE * half], _LOW_PAIR)
        scatter = float(high - low) / _LOW_PAIR_SPREADS
        is_light = mean > SPREADS * max(scatter, 1 / BOX_PX)
        lit |= np.bincount(rings[is_light], minlength=half + 1)[: half + 1] > 0
    last = 0
    for ring in np.flatnonzero(lit):
        if ring - last > GAP_PX:
            break
        last = int(ring)
    return int(min(half, max(last + MARGIN_PX, LEAST_HALF_PX)))


def smooth_noise(light: FloatGrid, noise: FloatGrid) -> FloatGrid:
    """Return (side, side) light, averaged where only noise is seen.

    Args:
        light: Background taken off, noise around zero.
        noise: Its standard deviation per sample.
    """
    mean = ndimage.uniform_filter(light, BOX_PX, mode="mirror")
    scatter = ndimage.uniform_filter((light - mean) ** 2, BOX_PX, mode="mirror")
    expected = ndimage.uniform_filter(noise**2, BOX_PX, mode="mirror")
    share = np.clip(1 - expected / np.maximum(scatter, 1e-300), 0, 1)
    return np.asarray(mean + share * (light - mean))


def cropped(light: FloatGrid, half: int) -> FloatGrid:
    """Cut (..., side, side) down to 2 half + 1 around its middle."""
    middle = light.shape[-1] // 2
    inside = slice(middle - half, middle + half + 1)
    return light[..., inside, inside]


def _rings(side: int) -> np.ndarray[tuple[int, int], np.dtype[np.intp]]:
    offset = np.abs(np.arange(side) - side // 2)
    return np.maximum(offset[:, None], offset[None])
