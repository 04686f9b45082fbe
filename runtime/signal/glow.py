"""The test whether a sample that stands out is light: a lens spreads light over its neighbours.

x . o . x      o: the other colours beside a sample, which rise with it when it is light
. . o . .      x: their own neighbours, two rows or columns away
o o s o o      s: the sample
. . o . .
x . o . x
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray

MARGIN_PX: Final = 2
"""Rows and columns of context that a sample needs."""

OUTLIER_SPREADS: Final = 2.0
"""A sample is apart when it lies farther outside its neighbours than this many of their spreads; of
pure noise one in a hundred thousand does."""

_GLOW_SHARE: Final = 0.1

Places = NDArray[np.intp]


def neighbours(padded: NDArray[Any], rows: Places, cols: Places, step: int) -> FloatArray:
    """Return the eight samples at a distance of `step`.

    Args:
        padded: (h + 4, w + 4): a mosaic or a plane with `MARGIN_PX` of context on every side.
        rows: (n,) rows of the samples, counted without the context.
        cols: (n,) their columns.
        step: 2 for those of the same colour of a mosaic, 1 in a plane.

    Returns:
        (8, n) of the type of `padded`.
    """
    offsets = [(dy, dx) for dy in (-step, 0, step) for dx in (-step, 0, step) if dy or dx]
    return np.stack([padded[rows + MARGIN_PX + dy, cols + MARGIN_PX + dx] for dy, dx in offsets])


def glows(padded: FloatArray, rows: Places, cols: Places) -> NDArray[np.bool_]:
    """Return where the other colours beside a sample of a mosaic rise with it, as for light.

    Args:
        padded: As for `neighbours`, float.
        rows: (n,) rows of the samples.
        cols: (n,) their columns.

    Returns:
        (n,) bool.
    """

    def at(dy: int, dx: int) -> FloatArray:
        return np.asarray(padded[rows + MARGIN_PX + dy, cols + MARGIN_PX + dx])

    row_rise = at(0, -1) + at(0, 1) - 0.5 * (at(-2, -1) + at(-2, 1) + at(2, -1) + at(2, 1))
    column_rise = at(-1, 0) + at(1, 0) - 0.5 * (at(-1, -2) + at(-1, 2) + at(1, -2) + at(1, 2))
    same = np.median(neighbours(padded, rows, cols, 2), axis=0)
    excess = at(0, 0) - same
    return np.asarray((row_rise + column_rise) * np.sign(excess) > _GLOW_SHARE * np.abs(excess))
