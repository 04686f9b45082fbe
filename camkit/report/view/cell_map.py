"""Cells in which the plan of a capture spared work, as rectangles of the upright picture."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from camkit.runtime.geometry.turning import turn
from camkit.runtime.plan.decision import TIER_NAMES

FULL_LETTER: Final = "F"
TIER_WORDS: Final = {
    "P": "neither network nor filter bank",
    "W": "filter bank without a network",
    "S": "smaller network",
}
assert {name[0].upper() for name in TIER_NAMES} == {*TIER_WORDS, FULL_LETTER}


def spared_cells(
    record: Mapping[str, Any], size_px: tuple[int, int]
) -> list[tuple[int, int, int, int, str]] | None:
    """Return (left, top, width, height, letter) of the cells that do not get the full network.

    Args:
        record: A sidecar.
        size_px: (height, width) of the upright picture.

    Returns:
        None where the sidecar has no map of cells that fits the picture.
    """
    cells, orientation = record.get("plan", {}).get("cells"), record.get("orientation", 1)
    if not isinstance(cells, dict) or orientation not in range(1, 9):
        return None
    side, rows = int(cells["side_px"]), cells["rows"]
    height, width = size_px if orientation < 5 else size_px[::-1]
    if len({*map(len, rows)}) != 1:
        return None
    grid = np.array([list(row) for row in rows])
    if grid.shape != (-(-height // side), -(-width // side)):
        return None
    down = _edges(height, side, len(rows))
    across = _edges(width, side, grid.shape[1])
    tops, lefts = np.meshgrid(down[:-1], across[:-1], indexing="ij")
    bottoms, rights = np.meshgrid(down[1:], across[1:], indexing="ij")
    if orientation >= 5:
        tops, lefts, bottoms, rights = lefts, tops, rights, bottoms
    if orientation in {2, 3, 6, 7}:
        lefts, rights = size_px[1] - rights, size_px[1] - lefts
    if orientation in {3, 4, 7, 8}:
        tops, bottoms = size_px[0] - bottoms, size_px[0] - tops
    letters = turn(grid, orientation)
    places = [turn(values, orientation) for values in (lefts, tops, rights, bottoms)]
    return [
        (int(a), int(b), int(c - a), int(d - b), str(letter))
        for a, b, c, d, letter in zip(*(p.ravel() for p in places), letters.ravel(), strict=True)
        if letter in TIER_WORDS
    ]


def _edges(length: int, side: int, count: int) -> np.ndarray[Any, Any]:
    return np.minimum(np.arange(count + 1) * side, length)
