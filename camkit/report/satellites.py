"""Satellites: light around stars that the sky does not hold, as a share of a star.

    a star: core | annulus where there should be sky | ring that tells what the sky is

Light above the sky and light that lacks below it are counted apart, since a ripple has both and
its sum is none. Noise has both alike: what it adds to each on average, by the median deviation of
the sky far from all stars, is taken off.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.arrays import FloatArray

CORE_PX: Final = 3.0
"""A star of the scenes ends within it."""
ANNULUS_PX: Final = 12.0
RING_PX: Final = 16.0
LEAST_STAR: Final = 0.02
"""Of the brightest pixel of a picture of stars: the brightest of a star."""
MEDIAN_OF_NORMAL: Final = 0.6745
"""Median of |x| of a normal distribution of variance 1."""

Grid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Satellites:
    """Light around stars, in shares of their true light.

    Attributes:
        above: (n,) more than the sky, >= 0.
        below: (n,) less than the sky, as a number >= 0.
        core: (n,) what is left of the star itself.
    """

    above: Grid
    below: Grid
    core: Grid


def satellites(picture: FloatArray, truth: FloatArray) -> Satellites:
    """Measure what lies around stars, all colours added up.

    Args:
        picture: (3, h, w) linear.
        truth: (3, h, w) linear: stars on a dark sky, `ANNULUS_PX` and `RING_PX` together from each
            other. Those that have no sky all around them are left out.
    """
    stars = find_stars(truth)
    noise = _noise(picture, stars)
    above, below, core = np.empty((3, len(stars)))
    for i, place in enumerate(stars):
        window, distance_px = _star_window(place)
        annulus = (distance_px > CORE_PX) & (distance_px <= ANNULUS_PX)
        ring = (distance_px > ANNULUS_PX) & (distance_px <= RING_PX)
        light_map, true = (_above_sky(p[window], ring) for p in (picture, truth))
        light = true[:, distance_px <= ANNULUS_PX].sum()
        expected = noise * np.count_nonzero(annulus)
        above[i] = (np.maximum(light_map[:, annulus], 0).sum() - expected) / light
        below[i] = (np.maximum(-light_map[:, annulus], 0).sum() - expected) / light
        core[i] = light_map[:, distance_px <= CORE_PX].sum() / light
    return Satellites(above=np.maximum(above, 0), below=np.maximum(below, 0), core=core)


def find_stars(truth: FloatArray) -> Grid:
    """Return (n, 2) (y, x), the middles of stars with sky all around them."""
    plane = truth.sum(axis=0, dtype=np.float64)
    plane -= np.median(plane)
    reach = int(CORE_PX) + 1
    brightest = scipy.ndimage.maximum_filter(plane, 2 * reach + 1) == plane
    peaks = np.argwhere(brightest & (plane > LEAST_STAR * plane.max()))
    edge = int(RING_PX) + 2
    inside = ((peaks >= edge) & (peaks < np.array(plane.shape) - edge)).all(axis=1)
    offset = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    middles = []
    for y, x in peaks[inside]:
        spot = plane[y - reach : y + reach + 1, x - reach : x + reach + 1]
        middles.append(np.array([y, x]) + (offset * spot).sum(axis=(1, 2)) / spot.sum())
    return np.array(middles).reshape(-1, 2)


def _star_window(place: Grid) -> tuple[tuple[slice, ...], Grid]:
    """Return the window of a star, and how far its pixels are from it."""
    reach = int(RING_PX) + 1
    top, left = (round(float(v)) - reach for v in place)
    side = 2 * reach + 1
    y, x = np.mgrid[top : top + side, left : left + side]
    window = np.s_[:, top : top + side, left : left + side]
    return window, np.hypot(y - place[0], x - place[1])


def _above_sky(window: FloatArray, ring: NDArray[np.bool_]) -> Grid:
    sky = np.median(window[:, ring], axis=1)
    return np.asarray(window.astype(np.float64) - sky[:, None, None])


def _noise(picture: FloatArray, stars: Grid) -> float:
    """Return what noise alone adds above the sky in a pixel, all colours added up."""
    height, width = picture.shape[1:]
    sky_mask = np.ones((height, width), dtype=bool)
    edge = int(RING_PX)
    sky_mask[:edge] = sky_mask[-edge:] = sky_mask[:, :edge] = sky_mask[:, -edge:] = False
    for place in stars:
        window, distance_px = _star_window(place)
        sky_mask[window[1:]] &= distance_px > RING_PX
    if not sky_mask.any():
        return 0.0
    sky = picture[:, sky_mask].astype(np.float64)
    middle = np.median(sky, axis=1, keepdims=True)
    sigma = np.median(np.abs(sky - middle), axis=1) / MEDIAN_OF_NORMAL
    return float(sigma.sum() / np.sqrt(2 * np.pi))
