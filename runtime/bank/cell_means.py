"""A capture in coarse cells: the mean of every colour's samples, and whether one of them clipped.

Cells begin at the first pixel; what is left over at the right and lower border is a cell of its own
from half a cell on, else it belongs to its neighbour. A row of cells depends on its own rows alone.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern, cfa_channels
from camkit.runtime.rows import RowSource

COLOURS = 3


def cell_count(side_px: int, cell_px: int) -> int:
    """Return the cells along a side."""
    return max(1, (side_px + cell_px // 2) // cell_px)


def cell_means(
    samples: RowSource, clipped: RowSource | None, cfa: CfaPattern | None, cell_px: int
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Read a capture from top to bottom.

    Args:
        samples: (1, h, w) of a mosaic or (c, h, w).
        clipped: (1 or c, h, w) bool; None where nothing is known of that.
        cfa: Of the mosaic; None for planes.
        cell_px: Side of a cell, even.

    Returns:
        (c, rows, columns) float32 means, a sample that is no number counted as dark, one beyond all
        numbers as white, and 0 where a colour has no sample; the same shape, true where a sample of
        the colour clipped.
    """
    count, height, width = samples.shape
    channels = count if cfa is None else COLOURS
    rows, columns = cell_count(height, cell_px), cell_count(width, cell_px)
    means = np.empty((channels, rows, columns), np.float32)
    clipped_cells = np.zeros(means.shape, np.bool_)
    for row in range(rows):
        top, bottom = row * cell_px, height if row + 1 == rows else (row + 1) * cell_px
        band = np.nan_to_num(samples.read(top, bottom), nan=0.0, posinf=1.0, neginf=0.0)
        mask = None if clipped is None else clipped.read(top, bottom)
        for channel, places in enumerate(_sites(cfa, channels)):
            total, number = np.zeros(columns), np.zeros(columns)
            for plane, down, across in places:
                line = band[plane, down, across].sum(axis=0, dtype=np.float64)
                total += _gathered(line, columns, cell_px, across)
                tall = len(range(*down.indices(band.shape[1])))
                number += tall * _gathered(np.ones(line.size), columns, cell_px, across)
                if mask is not None:
                    hit = np.asarray(mask[min(plane, len(mask) - 1), down, across].any(axis=0))
                    clipped_cells[channel, row] |= _gathered(hit, columns, cell_px, across) > 0
            means[channel, row] = total / np.maximum(number, 1)
    return means, clipped_cells


def _sites(cfa: CfaPattern | None, channels: int) -> Iterator[list[tuple[int, slice, slice]]]:
    """Yield the (plane, rows, columns) that hold the samples of every channel."""
    if cfa is None:
        yield from ([(plane, slice(None), slice(None))] for plane in range(channels))
        return
    colours = cfa_channels(cfa)
    for channel in range(channels):
        yield [
            (0, slice(y, None, 2), slice(x, None, 2))
            for y in (0, 1)
            for x in (0, 1)
            if colours[y][x] == channel
        ]


def _gathered(
    line: NDArray[np.float64] | NDArray[np.bool_], columns: int, cell_px: int, sites: slice
) -> NDArray[np.float64]:
    """Return the sums over cells of samples along a row; the last cell takes the rest."""
    if not line.size:  # a colour without a column in a capture one pixel wide
        return np.zeros(columns)
    first = np.arange(columns) * cell_px // (sites.step or 1)
    return np.asarray(np.add.reduceat(line.astype(np.float64), first))
