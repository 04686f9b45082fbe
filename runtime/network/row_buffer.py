"""The padded rows around the windows in work; every row of the source is read once."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.rows import RowSource

_READ_ROWS: Final = 64


class RowBuffer:
    """So many rows of a picture padded at its far sides by repeating its edge."""

    def __init__(self, source: RowSource, rows: int, padded: tuple[int, int]) -> None:
        """Allocate the buffer.

        Args:
            source: (c, h, w) picture.
            rows: Rows held at a time, at most the padded height.
            padded: (height, width) after padding, at least those of the source.

        Raises:
            ContractError: If the sizes contradict each other.
        """
        channels, height, width = source.shape
        if not (1 <= rows <= padded[0] and height <= padded[0] and width <= padded[1]):
            raise ContractError(f"{rows} rows of {padded} do not hold a picture {source.shape}")
        self._source = source
        self._rows = np.empty((channels, rows, padded[1]), np.float32)
        self._top = 0
        self._end = 0

    def move_to(self, top: int) -> FloatArray:
        """Return the rows from `top` on, (c, rows, padded w); never above an earlier `top`."""
        overlap = self._end - top
        if 0 < overlap < self._rows.shape[1]:
            self._rows[:, :overlap] = self._rows[:, top - self._top : self._end - self._top]
        self._top = top
        bottom = top + self._rows.shape[1]
        _, height, width = self._source.shape
        while self._end < min(bottom, height):
            stop = min(self._end + _READ_ROWS, bottom, height)
            target = self._rows[:, self._end - top : stop - top]
            target[:, :, :width] = self._source.read(self._end, stop)
            target[:, :, width:] = target[:, :, width - 1 : width]
            self._end = stop
        if bottom > self._end:
            self._rows[:, self._end - top :] = self._rows[:, self._end - top - 1, None]
            self._end = bottom
        return self._rows
