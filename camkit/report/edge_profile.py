"""The profile across a straight edge, finer than the pixels, and its spectrum.

samples at their distances from the edge -> means of narrow bins -> differences, window -> DFT

The differences near the edge count in full; towards the end of the reach they are noise and fade.

References: ISO 12233 (the slanted edge); Burns 2000, "Slanted-edge MTF for digital camera and
scanner analysis".
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError

FloatLine = NDArray[np.float64]

BINS_PER_PX: Final = 4
MOST_GAP: Final = 0.6
"""Between the distances of two samples, as a share of a bin."""
_NEAR_PX: Final = 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bins:
    """The samples of a picture, sorted by their distance from an edge.

    Attributes:
        number: (sample,) bin of every sample that lies within the reach.
        inside: (h, w) bool: which samples these are.
        counts: (bin,) samples of each, >= 1.
        places: (bin,) their mean distance, px.
        reach_px: How far from the edge samples are looked at, each way.
        bins_per_px: How many times finer than the pixels.
    """

    number: NDArray[np.intp]
    inside: NDArray[np.bool_]
    counts: FloatLine
    places: FloatLine
    reach_px: int
    bins_per_px: int

    def means(self, picture: NDArray[Any]) -> FloatLine:
        """Return the profile (bin,) of a picture (h, w)."""
        values = np.asarray(picture, np.float64)[self.inside]
        return np.bincount(self.number, values, self.counts.size) / self.counts


def sort_samples(
    distance_px: NDArray[Any],
    reach_px: int,
    *,
    bins_per_px: int = BINS_PER_PX,
    sites: NDArray[np.bool_] | None = None,
) -> Bins:
    """Sort samples into bins.

    Args:
        distance_px: (h, w) of every sample from the edge, with a sign.
        reach_px: How far from the edge samples are looked at, each way.
        bins_per_px: How many times finer than the pixels.
        sites: (h, w), which samples there are; None for all.

    Raises:
        ContractError: If the edge does not show all positions within a pixel.
    """
    number = np.floor(distance_px * bins_per_px).astype(np.intp) + reach_px * bins_per_px
    count = 2 * reach_px * bins_per_px
    inside = (number >= 0) & (number < count)
    if sites is not None:
        inside &= sites
    counts = np.bincount(number[inside], minlength=count).astype(np.float64)
    near = np.sort(distance_px[inside & (np.abs(distance_px) < _NEAR_PX)])
    gap = float(np.diff(near).max()) if near.size > 1 else math.inf
    if (counts == 0).any() or gap > MOST_GAP / bins_per_px:
        raise ContractError(
            "the edge does not show every position within a pixel: its samples leave gaps of up to "
            f"{gap:.2g} px; turn it by a degree or two, or make the picture longer along it"
        )
    number, distance = number[inside], distance_px[inside]
    places = np.bincount(number, distance, count) / counts
    return Bins(
        number=number,
        inside=inside,
        counts=counts,
        places=places,
        reach_px=reach_px,
        bins_per_px=bins_per_px,
    )


def edge_waves(bins: Bins, cycles_per_px: NDArray[Any]) -> NDArray[np.complex128]:
    """Return the matrix (frequency, bin) that takes a profile to the spectrum of its slope.

    It moves every mean from where its samples lie to the middle of its bin, takes differences of
    neighbours, lets them fade towards the end of the reach, and transforms them. What means and
    differences leave of every frequency, a sinc of their width each, is given back.
    """
    count, width = bins.counts.size, 1 / bins.bins_per_px
    frequency = np.asarray(cycles_per_px, np.float64)[:, None]
    where = (np.arange(count - 1) - (count - 2) / 2) * width
    fade = np.cos(np.pi * np.clip(np.abs(where) / bins.reach_px - 0.5, 0, None)) ** 2
    waves = fade * np.exp(-2j * np.pi * frequency * where) / np.sinc(frequency * width) ** 2
    none = np.zeros((waves.shape[0], 1))
    return np.asarray((np.hstack([none, waves]) - np.hstack([waves, none])) @ _to_middles(bins))


def _to_middles(bins: Bins) -> FloatLine:
    """Return the matrix (bin, bin) that moves means along the line through their neighbours."""
    count = bins.counts.size
    middles = (np.arange(count) - (count - 1) / 2) / bins.bins_per_px
    before, after = np.arange(count)[:-2], np.arange(count)[2:]
    weights = (middles - bins.places)[1:-1] / (bins.places[after] - bins.places[before])
    matrix = np.eye(count)
    matrix[before + 1, after] += weights
    matrix[before + 1, before] -= weights
    return matrix
