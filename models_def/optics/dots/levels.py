"""Phases -> levels that can be etched: rounded, then each cell tried at every level.

A rounded plate is a fifth as like the target as it was. A cell moves the amplitudes of the dots by
a known number times an outer product, so trying a level costs 121 sums, and thousands of cells are
tried, one after another, until none can be bettered.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.models_def.optics.dots.merit import Merit
from camkit.models_def.optics.dots.orders import ComplexGrid, intensity, order_matrix, orders_of
from camkit.models_def.optics.dots.target import FloatGrid

SWEEPS: Final = 40
STILL: Final = 1e-3
"""Share of the cells; where fewer move in a sweep, no more sweeps are made."""
_LEAST: Final = 1e-12
LevelGrid = NDArray[np.int64]


def rounded(phase: FloatGrid, levels: int) -> LevelGrid:
    """Return the nearest levels (cells, cells), 0 .. levels - 1, of phases in radians."""
    return np.rint(phase * levels / (2 * np.pi)).astype(np.int64) % levels


def level_field(levels: int) -> ComplexGrid:
    """Return the field (levels,) behind a cell of each level."""
    return np.asarray(np.exp(2j * np.pi * np.arange(levels) / levels))


def descend(
    level: LevelGrid, levels: int, merit: Merit, rng: np.random.Generator, sweeps: int = SWEEPS
) -> LevelGrid:
    """Return levels none of which can be changed alone for the better, or nearly so.

    Args:
        level: (cells, cells) to begin at.
        levels: How many there are.
        merit: To be made small.
        rng: For the order in which cells are tried.
        sweeps: Over all cells, at most.
    """
    fields = level_field(levels)
    matrix = order_matrix(level.shape[0], merit.target.shape[0])
    refined = level.copy()
    for _ in range(sweeps):
        # anew, so that roundings of many updates do not add up
        dots = orders_of(fields[refined], matrix)
        if _sweep(refined, dots, fields, matrix, merit, rng) < STILL * level.size:
            break
    return refined


def shifted_orders(
    dots: ComplexGrid, cell: tuple[int, int], change: NDArray[np.complex128], matrix: ComplexGrid
) -> ComplexGrid:
    """Return the amplitudes (..., n, n) of dots after the field of one cell changed.

    Args:
        dots: (n, n) before.
        cell: (row, column).
        change: (...) of its field.
        matrix: Of `order_matrix`.
    """
    row, column = cell
    reach = np.outer(matrix[:, row], matrix[:, column])
    return np.asarray(dots + change[..., None, None] * reach)


def _sweep(
    level: LevelGrid,
    dots: ComplexGrid,
    fields: ComplexGrid,
    matrix: ComplexGrid,
    merit: Merit,
    rng: np.random.Generator,
) -> int:
    """Try every cell once, in `level` itself, and count those that moved."""
    best, count = float(merit.of(intensity(dots))), 0
    for place in rng.permutation(level.size):
        row, column = divmod(int(place), level.shape[1])
        candidates = shifted_orders(
            dots, (row, column), fields - fields[level[row, column]], matrix
        )
        merits = merit.of(intensity(candidates))
        choice = int(merits.argmin())
        if merits[choice] < best - _LEAST:
            level[row, column], dots, best = choice, candidates[choice], float(merits[choice])
            count += 1
    return count
