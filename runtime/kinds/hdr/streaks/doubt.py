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

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.cell_rows import rows_of_cells
from camkit.runtime.kinds.hdr.streaks.cells import PITCH_PX
from camkit.runtime.kinds.hdr.streaks.shapes import widened

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
RUN: Final = 8 * BLOCK
"""Samples of a lattice; columns of so many without doubt are left out."""
Mask = NDArray[np.bool_]
Lattices = Sequence[FloatArray]
"""(h, w) each: samples of one colour at one place of every cell of 2 px."""


def settled(rest: Lattices, streaks: Lattices, clipped: Sequence[Mask]) -> list[FloatArray]:
    """Return samples of a colour with those in doubt nearer to their surroundings.

    Args:
        rest: Samples less their streaks, 1.0 = where samples clip. The first row of the mosaic is a
            multiple of `BLOCK_PX` in its picture, and rows within `MARGIN_PX` of a cut are of no
            use.
        streaks: What was taken away.
        clipped: Samples that say nothing; they stay as they are.
    """
    out = [plane.copy() for plane in rest]
    brightest = [widened(plane, 1, 1) for plane in streaks]
    for first, end in _runs(brightest):
        start = max(first - MARGIN_PX // PITCH_PX, 0)
        cut = np.s_[:, start : end + MARGIN_PX // PITCH_PX]
        light, dimming, bright = ([p[cut] for p in planes] for planes in (rest, streaks, brightest))
        samples = _shrunk(light, dimming, [plane[cut] for plane in clipped], bright)
        for plane, near in zip(out, samples, strict=True):
            plane[:, first:end] = near[:, first - start : end - start]
    return out


def _runs(brightest: Lattices) -> Iterator[tuple[int, int]]:
    """Yield the columns, from first to end, among which samples are in doubt."""
    columns = max(plane.shape[1] for plane in brightest)
    some = np.zeros(-(-columns // RUN) * RUN, np.bool_)
    for plane in brightest:
        some[: plane.shape[1]] |= (plane > np.float32(SURE / DOUBT)).any(axis=0)
    edges = np.diff(np.pad(some.reshape(-1, RUN).any(axis=1), 1).astype(np.int8))
    ends = zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True)
    for first, end in ends:
        yield int(first) * RUN, int(end) * RUN


def _shrunk(
    rest: Lattices, streaks: Lattices, clipped: Sequence[Mask], brightest: Lattices
) -> Iterator[FloatArray]:
    """Yield samples nearer to the mean of their surroundings, weighted by doubt."""
    doubts = [np.float32(DOUBT) * plane for plane in brightest]
    doubts = [np.square(plane, out=plane) for plane in doubts]
    weight, mean, square = _local_moments(rest, clipped, doubts)
    moments: dict[tuple[int, ...], tuple[FloatArray, FloatArray]] = {}
    for plane, streak, mask, doubt in zip(rest, streaks, clipped, doubts, strict=True):
        if plane.shape not in moments:
            moments[plane.shape] = _mean_and_spread(weight, mean, square, plane.shape)
        middle, spread = moments[plane.shape]
        share = spread + doubt
        np.divide(spread, share, out=share)
        samples = plane - middle
        samples *= share
        samples += middle
        # no streak takes light away, none leaves less than nothing
        light = plane + streak
        np.maximum(samples, np.minimum(light, 0, out=share), out=samples)
        np.minimum(samples, light, out=samples)
        np.copyto(samples, plane, where=mask | (doubt <= SURE**2))
        yield samples


def _mean_and_spread(
    weight: FloatArray, mean: FloatArray, square: FloatArray, shape: tuple[int, ...]
) -> tuple[FloatArray, FloatArray]:
    """Return the mean of what lies around each sample (h, w) of `shape`, and its variance."""
    whole = np.maximum(_interpolated(weight, shape), _TINY)
    middle = _interpolated(mean, shape)
    middle /= whole
    spread = _interpolated(square, shape)
    spread /= whole
    spread -= middle * middle
    return middle, np.maximum(spread, _LEAST, out=spread)


def _local_moments(
    rest: Lattices, clipped: Sequence[Mask], doubts: Lattices
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return sums of weights, of samples and of their squares, in squares of all lattices."""
    height, width = (max(plane.shape[axis] for plane in rest) for axis in (0, 1))
    sums = np.zeros((3, -(-height // BLOCK), -(-width // BLOCK)), np.float32)
    for samples, mask, doubt in zip(rest, clipped, doubts, strict=True):
        weight = np.float32(NOISE**2) + doubt
        np.divide(np.float32(NOISE**2), weight, out=weight)
        np.copyto(weight, 0, where=mask)
        for number, part in enumerate(_moments(weight, samples)):
            sums[number] += _in_squares(part, sums.shape[1:])
    for axis in (1, 2):
        sums = scipy.ndimage.correlate1d(sums, _SMOOTH, axis, mode="nearest")
    return sums[0], sums[1], sums[2]


def _moments(weight: FloatArray, rest: FloatArray) -> Iterator[FloatArray]:
    yield weight
    first = weight * rest
    yield first
    yield first * rest


def _in_squares(plane: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return sums over squares of `BLOCK` samples; what lies beyond the border adds nothing."""
    more = [(0, BLOCK * n - side) for n, side in zip(shape, plane.shape, strict=True)]
    whole = np.pad(plane, more) if any(end for _, end in more) else plane
    rows = whole[::BLOCK].copy()
    for k in range(1, BLOCK):
        rows += whole[k::BLOCK]
    squares = rows[:, ::BLOCK].copy()
    for k in range(1, BLOCK):
        squares += rows[:, k::BLOCK]
    return squares


def _interpolated(squares: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return samples (h, w) of `shape`, linear between the middles of squares."""
    return rows_of_cells(squares, BLOCK, (_MIDDLE, _MIDDLE), 0, shape[0], shape[1])
