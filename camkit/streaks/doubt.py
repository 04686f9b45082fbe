"""Samples whose streaks were taken away, believed as far as the streaks are known.

    samples less streaks, how uncertain that is -> mean and spread of what lies around, by weight
    as uncertain as that spread or more         -> nearer to the mean

A light that is found a little too broad or too bright takes more than its streaks: two dark lines
are left beside each. What is left there is known no better than the streaks are, so it counts as
one measurement and its surroundings as another (a Wiener filter of what is in doubt).
"""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.streaks.cell_rows import rows_of_cells
from camkit.streaks.cells import PITCH_PX, Sites

DOUBT: Final = 0.15
"""Share of the brightest streak at a sample or beside it by which that sample is uncertain."""
SURE: Final = 3e-4
"""Of white: what is less in doubt stays as it is."""
NOISE: Final = 3e-3
"""Of white: of samples without streaks, beside doubt."""
BLOCK: Final = 4
"""Samples of a lattice on a side of the squares whose means are taken."""
BLOCK_PX: Final = BLOCK * PITCH_PX
MARGIN_PX: Final = 3 * BLOCK_PX
"""Means reach so far: a square smoothed with its neighbours, on to the next middle, and doubt."""
_MIDDLE: Final = (BLOCK - 1) / 2
_SMOOTH: Final = np.array([0.25, 0.5, 0.25], np.float32)
_LEAST: Final = 1e-7
_TINY: Final = 1e-12
Mask = NDArray[np.bool_]
At = tuple[slice, slice]


def settled(
    rest: FloatArray, thrown: FloatArray, clipped: Mask, sites: Sequence[Sites]
) -> FloatArray:
    """Return samples with those in doubt nearer to their surroundings.

    Args:
        rest: (h, w) mosaic less its streaks, 1.0 = where samples clip. The first row is a multiple
            of `BLOCK_PX` in its picture, and rows within `MARGIN_PX` of a cut are of no use.
        thrown: (h, w) the streaks.
        clipped: (h, w): samples that say nothing; they stay as they are.
        sites: Of every colour in a cell of 2 px.
    """
    out = rest.copy()
    for places in sites:
        lattices = [np.s_[y::PITCH_PX, x::PITCH_PX] for y, x in places]
        doubts = [_doubt(thrown[at]) for at in lattices]
        if all((doubt <= SURE**2).all() for doubt in doubts):
            continue
        weight, mean, square = _around(rest, clipped, lattices, doubts)
        for at, doubt in zip(lattices, doubts, strict=True):
            shape = doubt.shape
            whole = np.maximum(_laid(weight, shape), _TINY)
            middle = _laid(mean, shape) / whole
            spread = np.maximum(_laid(square, shape) / whole - middle**2, _LEAST)
            found = middle + spread / (spread + doubt) * (rest[at] - middle)
            # no streak takes light away, none leaves less than nothing
            seen = rest[at] + thrown[at]
            found = np.clip(found, np.minimum(seen, 0), seen)
            out[at] = np.where(clipped[at] | (doubt <= SURE**2), rest[at], found)
    return out


def _doubt(thrown: FloatArray) -> FloatArray:
    """Return the variance of a lattice of samples whose streaks were taken away."""
    brightest = scipy.ndimage.maximum_filter(thrown, 3, mode="nearest")
    return np.asarray(np.square(np.float32(DOUBT) * brightest), np.float32)


def _around(
    rest: FloatArray, clipped: Mask, lattices: Sequence[At], doubts: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return sums of weights, of samples and of their squares, in squares of all lattices."""
    height, width = ((side + 1) // PITCH_PX for side in rest.shape)
    sums = np.zeros((3, -(-height // BLOCK), -(-width // BLOCK)), np.float32)
    for at, doubt in zip(lattices, doubts, strict=True):
        weight = np.where(clipped[at], 0, np.float32(NOISE**2) / (np.float32(NOISE**2) + doubt))
        for number, part in enumerate(_moments(weight, rest[at])):
            sums[number] += _in_squares(part, sums.shape[1:])
    for axis in (1, 2):
        sums = scipy.ndimage.correlate1d(sums, _SMOOTH, axis, mode="nearest")
    return sums[0], sums[1], sums[2]


def _moments(weight: FloatArray, rest: FloatArray) -> Iterator[FloatArray]:
    yield weight
    yield weight * rest
    yield weight * rest**2


def _in_squares(plane: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return sums over squares of `BLOCK` samples; what lies beyond the border adds nothing."""
    more = [(0, BLOCK * n - side) for n, side in zip(shape, plane.shape, strict=True)]
    whole = np.pad(plane, more).reshape(shape[0], BLOCK, shape[1], BLOCK)
    return np.asarray(whole.sum(axis=(1, 3)), np.float32)


def _laid(squares: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return samples (h, w) of `shape`, linear between the middles of squares."""
    return rows_of_cells(squares, BLOCK, (_MIDDLE, _MIDDLE), 0, shape[0], shape[1])
