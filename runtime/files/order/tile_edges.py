"""Tiles that a decoder went on over damage in: from some row on, their border is an edge.

A stream of one tile breaks for itself, and what follows in it is noise, grey or of another level.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

Steps = NDArray[np.float32]

_LEAST_ROWS: Final = 12
_LEAST_TILE: Final = 16
_LEAST_TILE_ROWS: Final = 96
_MOST_STEP: Final = 12.0
_EDGE: Final = 4.0
_CALM: Final = 2.0
_REST: Final = 0.6
_SPREADS: Final = 6.0
_ROW_STEP: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class TileGrid:
    """Tiles of a picture.

    Attributes:
        size: Height and width of a tile.
        first: Row and column of the first visible pixel in the whole picture.
    """

    size: tuple[int, int]
    first: tuple[int, int]

    def borders(self, axis: int, length: int, step: int) -> list[int]:
        """Return the cells that begin a tile, none at the border of the picture.

        Args:
            axis: 0 for rows, 1 for columns.
            length: Of the picture in cells.
            step: Pixels from one cell to the next.
        """
        size, first = self.size[axis], self.first[axis]
        if size < _LEAST_TILE * step:
            return []
        starts = (-(-(place - first) // step) for place in range(size, first + length * step, size))
        return [cell for cell in starts if _LEAST_TILE <= cell <= length - _LEAST_TILE]


def tile_doubt(cells: NDArray[np.float32], grid: TileGrid, step: tuple[int, int]) -> str:
    """Return the tile that has an edge along its border; empty for none.

    Args:
        cells: (h, w) light of one colour.
        grid: Tiles in pixels.
        step: Pixels from one cell to the next, down and across.
    """
    steps = np.abs(np.diff(cells, axis=1))
    steps = np.minimum(steps / (steps.mean(axis=1, keepdims=True) + np.float32(1e-4)), _MOST_STEP)
    rows = [0, *grid.borders(0, cells.shape[0], step[0]), cells.shape[0]]
    columns = grid.borders(1, cells.shape[1], step[1])
    border_columns = np.unique([c + n for c in columns for n in (-2, -1, 0)]).astype(np.int64)
    for column in columns:
        for top, bottom in pairwise(rows):
            if _edge_begins(steps[top:bottom], column - 1, border_columns):
                return (
                    f"the tile at {column / cells.shape[1]:.0%} of the width and "
                    f"{top / cells.shape[0]:.0%} of the height has an edge along its border: the "
                    "pixel data are damaged"
                )
    return ""


def _edge_begins(steps: Steps, column: int, border_columns: NDArray[np.int64]) -> bool:
    """Return whether from some row on, to the end, a column is an edge and few others are.

    Args:
        steps: (h, w) steps across of the rows of a tile.
        column: At the border of the tile.
        border_columns: Columns at the borders of all tiles, which say nothing against it.
    """
    height, width = steps.shape
    if height < _LEAST_TILE_ROWS:
        return False
    sums = np.concatenate([np.zeros((1, width)), np.cumsum(steps, axis=0, dtype=np.float64)])
    rows = np.arange(_LEAST_ROWS, height - _LEAST_ROWS, _ROW_STEP)
    above, below = sums[rows] / rows[:, None], (sums[-1] - sums[rows]) / (height - rows)[:, None]
    rise = below - above
    best = int(np.argmax(rise[:, column] * np.sqrt(rows * (height - rows))))
    rest = np.delete(rise[best], border_columns)
    last = max(_LEAST_ROWS, int(height - rows[best]) // 4)
    to_the_end = (sums[-1, column] - sums[-1 - last, column]) / last
    return bool(
        to_the_end > _EDGE
        and below[best, column] > _EDGE
        and above[best, column] < _CALM
        and rest.max() < _REST * rise[best, column]
        and rise[best, column] > _SPREADS * rest.std()
    )
