"""Demosaicking along edges: the "quality" method of `camkit.runtime.signal.demosaic`.

    green along rows and along columns at every pixel that has none
      -> weight of the row direction: how much less the colour difference changes along it
      -> green -> red and blue at green pixels -> blue at red and red at blue
      -> refinement: colour differences smoothed along the weighted directions (a posteriori)

The order and the refinement are Menon's; the two directions are not chosen but weighted by the
inverse square of the change, which leaves smooth regions free of false decisions. A scaled mosaic
gives the scaled picture; nothing is clipped, negatives are kept.

The samples of a mosaic lie on four lattices, each a quarter of the picture, and everything is
computed on these. A tile begins and ends with a red pixel in both directions, so a lattice holds
the `even` pixels of a line (one more) or the `odd` ones, and all planes have one middle. What is
computed from neighbours is a little smaller than they are; `_inner` cuts planes to one size.

    red             | green of red rows        even, even | even, odd
    green of blue rows | blue                  odd, even  | odd, odd

References: Menon, Andriani, Calvagno, "Demosaicing with directional filtering and a posteriori
decision", IEEE Transactions on Image Processing 16(1), 2007. Pekkucuksen, Altunbasak, "Gradient
based threshold free color filter array interpolation", ICIP 2010 (the weights).
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from camkit.arrays import FloatArray

# green 2, its change 1, weights 2, red and blue 1 + 1, refinement 1 + 1 + 1
DIRECTIONAL_REACH_PX: Final = 10

_COLUMN: Final = 0
_ROW: Final = 1
_QUARTER: Final = np.float32(0.25)
_HALF: Final = np.float32(0.5)
_THIRD: Final = np.float32(1 / 3)


class _Lattices(NamedTuple):
    """A value of every pixel of a tile, one plane for each place in a cell."""

    red: FloatArray
    green_of_red: FloatArray
    green_of_blue: FloatArray
    blue: FloatArray


class _Colours(NamedTuple):
    """A value of every red and of every blue pixel of a tile."""

    red: FloatArray
    blue: FloatArray


class _GreenPair(NamedTuple):
    """A value of the green pixels beside those of one colour: in their rows, in their columns."""

    in_row: FloatArray
    in_column: FloatArray


def demosaic_tile(samples: FloatArray) -> FloatArray:
    """Interpolate a tile of a mosaic along edges.

    Args:
        samples: (h, w) float32 with red pixels in all four corners, both sides odd and larger than
            twice `DIRECTIONAL_REACH_PX`.

    Returns:
        (3, h - 2 reach, w - 2 reach) float32: the middle of the tile.
    """
    tile = _Lattices(*(samples[y::2, x::2].copy() for y in (0, 1) for x in (0, 1)))
    green, weight = _green_less_own(tile)
    pairs = [_sums_beside(plane) for plane in green]
    less_blue = [_QUARTER * sums for sums in _red_less_blue(pairs, weight)]
    green = _Colours(*map(_mean_of_three, green, map(_along_edges, pairs, weight)))
    pairs = [_sums_beside(plane) for plane in green]
    less_blue = list(map(_mean_of_three, less_blue, _red_less_blue(pairs, weight)))
    return _planes(tile, green, pairs, _Colours(*less_blue))


def _green_less_own(tile: _Lattices) -> tuple[_Colours, _Colours]:
    """Return green less the sample of red and blue pixels, and the weight 0..1 of their rows."""
    red, green_of_red, green_of_blue, blue = tile
    red_row, red_column = _bends(green_of_red, red, _ROW), _bends(green_of_blue, red, _COLUMN)
    blue_row, blue_column = _bends(green_of_blue, blue, _ROW), _bends(green_of_red, blue, _COLUMN)
    # Pekkucuksen 2010, eq. (4) to (6): green less the other colour, whichever is interpolated
    by_row = _Lattices(red_row[1], red_row[0], blue_row[0], blue_row[1])
    by_column = _Lattices(red_column[1], blue_column[0], red_column[0], blue_column[1])
    shapes = [(plane.shape[0] - 4, plane.shape[1] - 4) for plane in tile]
    across = _changes_around(by_column, shapes, _COLUMN)
    along = _changes_around(by_row, shapes, _ROW)
    weight = _Colours(*map(_share, across, along))
    pairs = _GreenPair(red_row[0], red_column[0]), _GreenPair(blue_row[0], blue_column[0])
    return _Colours(*(_QUARTER * sums for sums in map(_along_edges, pairs, weight))), weight


def _bends(green: FloatArray, other: FloatArray, axis: int) -> tuple[FloatArray, FloatArray]:
    """Return twice green less the other colour along their lines, one of them interpolated.

    Returns:
        At green pixels and at those of the other colour.
    """
    green_is_even = green.shape[axis] > other.shape[axis]
    even, odd = (green, other) if green_is_even else (other, green)
    first, last = _part(even, axis, 0, -1), _part(even, axis, 1)
    before, after = (first - odd, last - odd) if green_is_even else (odd - first, odd - last)
    at_odd = before + after
    at_even = _part(after, axis, 0, -1) + _part(before, axis, 1)
    return (at_even, at_odd) if green_is_even else (at_odd, at_even)


def _changes_around(bends: _Lattices, shapes: Sequence[tuple[int, int]], axis: int) -> _Colours:
    """Return the squares of the sums of changes along an axis in 5 x 5 pixels."""
    changes = []
    for bend, shape in zip(bends, shapes, strict=True):
        change = _part(bend, axis, 2) - _part(bend, axis, 0, -2)
        changes.append(_inner(np.abs(change, out=change), shape))
    even = _sums_of_five(changes[0], changes[1], _ROW)
    odd = _sums_of_five(changes[2], changes[3], _ROW)
    red, _ = _sums_of_five(even[0], odd[0], _COLUMN)
    _, blue = _sums_of_five(even[1], odd[1], _COLUMN)
    return _Colours(np.square(red, out=red), np.square(blue, out=blue))


def _sums_of_five(even: FloatArray, odd: FloatArray, axis: int) -> tuple[FloatArray, FloatArray]:
    """Return sums of five neighbours along an axis, about even pixels and about odd ones."""
    twos = _part(even, axis, 0, -1) + odd
    about_even = _part(twos, axis, 0, -1) + _part(twos, axis, 1)
    about_even += _part(even, axis, 2)
    about_odd = _part(twos, axis, 1, -1) + _part(twos, axis, 2)
    about_odd += _part(odd, axis, 0, -2)
    return about_even, about_odd


def _share(part: FloatArray, rest: FloatArray) -> FloatArray:
    """Return the share of a part of the whole; half of nothing."""
    whole = part + rest
    if whole.all():
        part /= whole
        return part
    share = np.full_like(part, 0.5)
    np.divide(part, whole, out=share, where=whole > 0)
    return share


def _sums_beside(plane: FloatArray) -> _GreenPair:
    """Return sums of the two neighbours of one colour at the green pixels beside it."""
    return _GreenPair(_pairs(plane, _ROW), _pairs(plane, _COLUMN))


def _along_edges(green: _GreenPair, row_weight: FloatArray) -> FloatArray:
    """Return sums of the two green neighbours of pixels, mixed by the weight of their rows."""
    by_row, by_column = _pairs(green.in_row, _ROW), _pairs(green.in_column, _COLUMN)
    planes = (by_row, by_column, row_weight)
    height, width = (min(plane.shape[axis] for plane in planes) for axis in (0, 1))
    by_row, by_column, weight = (_inner(plane, (height, width)) for plane in planes)
    mixed = by_row - by_column
    mixed *= weight
    mixed += by_column
    return mixed


def _red_less_blue(pairs: Sequence[_GreenPair], row_weight: _Colours) -> list[FloatArray]:
    """Return four times red less blue at red and at blue pixels, of green less each, doubled."""
    red, blue = pairs
    at_red_rows = _difference(blue.in_column, red.in_row)
    at_blue_rows = _difference(blue.in_row, red.in_column)
    return [
        _along_edges(_GreenPair(at_red_rows, at_blue_rows), row_weight.red),
        _along_edges(_GreenPair(at_blue_rows, at_red_rows), row_weight.blue),
    ]


def _mean_of_three(differences: FloatArray, neighbours: FloatArray) -> FloatArray:
    """Return the mean of differences and of two neighbours each, of which the sum is doubled."""
    mean = _HALF * neighbours
    mean += _inner(differences, mean.shape)
    mean *= _THIRD
    return mean


def _planes(
    tile: _Lattices, green: _Colours, pairs: Sequence[_GreenPair], less_blue: _Colours
) -> FloatArray:
    """Return the colours (3, h, w) of samples and of the differences beside them."""
    height, width = (2 * side - 1 for side in less_blue.red.shape)
    planes = np.empty((3, height, width), np.float32)
    at = [np.s_[y::2, x::2] for y in (0, 1) for x in (0, 1)]
    inner = _Lattices(
        *(_inner(plane, planes[0][s].shape) for plane, s in zip(tile, at, strict=True))
    )
    red, blue = pairs
    for place, samples, of_red, of_blue in (
        (at[1], inner.green_of_red, red.in_row, blue.in_column),
        (at[2], inner.green_of_blue, red.in_column, blue.in_row),
    ):
        planes[1][place] = samples
        for colour, twice in ((0, of_red), (2, of_blue)):
            planes[colour][place] = samples - _HALF * _inner(twice, samples.shape)
    for place, samples, more in ((at[0], inner.red, green.red), (at[3], inner.blue, green.blue)):
        planes[1][place] = samples + _inner(more, samples.shape)
    planes[0][at[0]], planes[2][at[3]] = inner.red, inner.blue
    planes[2][at[0]] = inner.red - less_blue.red
    planes[0][at[3]] = inner.blue + _inner(less_blue.blue, inner.blue.shape)
    return planes


def _difference(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the difference of two planes where both are."""
    shape = min(one.shape[0], other.shape[0]), min(one.shape[1], other.shape[1])
    return np.asarray(_inner(one, shape) - _inner(other, shape))


def _pairs(plane: FloatArray, axis: int) -> FloatArray:
    """Return sums of neighbours along an axis: at the pixels between them."""
    return np.asarray(_part(plane, axis, 0, -1) + _part(plane, axis, 1))


def _part(plane: FloatArray, axis: int, first: int, end: int | None = None) -> FloatArray:
    """Return a part of a plane along an axis."""
    return plane[first:end] if axis == _COLUMN else plane[:, first:end]


def _inner(plane: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return the middle of a plane."""
    top, left = ((have - want) // 2 for have, want in zip(plane.shape, shape, strict=True))
    return plane[top : top + shape[0], left : left + shape[1]]
