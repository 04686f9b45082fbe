"""Clipped cells that throw light on the same samples, in one window.

    clipped cells -> groups whose arms may cross -> windows that hold their arms

Groups follow from the capture alone.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
_EIGHT = np.ones((3, 3), np.int8)


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """A rectangle of cells; bottom and right are the first cells outside it."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def shape(self) -> tuple[int, int]:
        """Return (rows, columns)."""
        return self.bottom - self.top, self.right - self.left

    @property
    def at(self) -> tuple[slice, slice]:
        """Return the place in an array."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def shifted(self, rows: int, columns: int) -> "Window":
        """Return the same, so many cells farther down and to the right."""
        return Window(
            top=self.top + rows,
            bottom=self.bottom + rows,
            left=self.left + columns,
            right=self.right + columns,
        )

    def finer(self, shape: tuple[int, int]) -> "Window":
        """Return the same place in cells of half the pitch, of an array of that shape.

        A last odd row or column there, which no cell covers, goes with its neighbour.
        """
        return Window(
            top=2 * self.top,
            bottom=_finer_end(self.bottom, shape[0]),
            left=2 * self.left,
            right=_finer_end(self.right, shape[1]),
        )


def windows_of(clipped: Mask, reach: int) -> tuple[Window, ...]:
    """Group clipped cells and return each group's window, top to bottom, left to right.

    Two lights are of one group where squares of `reach` about them meet; a window that overlaps
    another's lights becomes one with it, so that no light is sought twice.

    Args:
        clipped: (h, w) cells with a clipped sample, of any colour.
        reach: Cells that an arm reaches.
    """
    if not clipped.any():
        return ()
    height, width = clipped.shape
    near = scipy.ndimage.maximum_filter(clipped, size=2 * reach + 1, mode="constant")
    labels, _ = scipy.ndimage.label(near, structure=_EIGHT)
    boxes = []
    for rows, columns in scipy.ndimage.find_objects(labels):
        boxes.append([rows.start, rows.stop, columns.start, columns.stop])
    merged = _merged(boxes)
    windows = [
        Window(
            top=max(top, 0), bottom=min(bottom, height), left=max(left, 0), right=min(right, width)
        )
        for top, bottom, left, right in merged
    ]
    return tuple(sorted(windows, key=lambda w: (w.top, w.left)))


def _finer_end(end: int, cells: int) -> int:
    return cells if 2 * end + 1 == cells else 2 * end


def _merged(boxes: list[list[int]]) -> list[list[int]]:
    """Join boxes that overlap until none do."""
    pending = list(boxes)
    disjoint: list[list[int]] = []
    while pending:
        box = pending.pop()
        hits = [other for other in (*pending, *disjoint) if _overlap(box, other)]
        if not hits:
            disjoint.append(box)
            continue
        pending = [other for other in pending if other not in hits]
        disjoint = [other for other in disjoint if other not in hits]
        every = np.array([box, *hits])
        low, high = every.min(axis=0), every.max(axis=0)
        pending.append([int(low[0]), int(high[1]), int(low[2]), int(high[3])])
    return disjoint


def _overlap(a: list[int], b: list[int]) -> bool:
    return a[0] < b[1] and b[0] < a[1] and a[2] < b[3] and b[2] < a[3]
