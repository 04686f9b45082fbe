"""Pictures as rows that are made when they are needed, so that no stage holds a whole picture.

Every stage reads rows from a `RowSource` and yields bands of finished rows from top to bottom;
`RollingRows` turns such bands into a source again and forgets rows that no reader still needs.

    capture -> [bands] -> RollingRows -> reader -> next stage -> [bands] -> ...
"""

import weakref
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.machine.slices import run_chunks

Rows = NDArray[Any]
"""(channel, rows, w): float32, or bool for a mask."""
BAND_ROWS: Final = 128
"""Rows read at a time where nothing asks for another number."""
STALE_ROWS: Final = 128
"""Rows of a band that may wait for their successors after their last reader has passed."""


class RowSource(Protocol):
    """A (channel, h, w) picture whose rows can be read from top to bottom."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w) of the whole picture."""
        ...

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (channel, bottom - top, w).

        Successive calls must not go back above the `top` of an earlier call.
        """
        ...


class PiecedRows(RowSource, Protocol):
    """A row source that can give its rows as they lie, without joining them."""

    def pieces(self, top: int, bottom: int) -> Sequence[Rows]:
        """Return rows top..bottom in consecutive pieces (channel, rows, w); otherwise as `read`."""
        ...


class ArrayRows:
    """A whole picture in memory as a row source."""

    def __init__(self, planes: Rows) -> None:
        if planes.ndim != 3:
            raise ContractError(f"planes must be (channel, h, w); got {planes.shape}")
        self._planes = planes

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w) of the whole picture."""
        c, h, w = self._planes.shape
        return c, h, w

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as a view."""
        return self._planes[:, top:bottom]

    def pieces(self, top: int, bottom: int) -> Sequence[Rows]:
        """Return the same view as the only piece."""
        return [self.read(top, bottom)]


def changed_bands(
    bands: Iterator[FloatArray], change: Callable[[FloatArray, int], None], *, threads: int = 1
) -> Iterator[FloatArray]:
    """Change bands in place by a pointwise function: readers of rows overlap, bands do not.

    Args:
        bands: (channel, rows, w) from top to bottom, each an array that nobody else reads.
        change: Changes rows; gets a few of them at a time and the number of the first, from
            several threads at once.
        threads: Threads that share the rows of a band; no influence on the bits.
    """
    top = 0
    for band in bands:

        def work(first: int, last: int, whole: FloatArray = band, first_row: int = top) -> None:
            change(whole[:, first:last], first_row + first)

        run_chunks(work, band.shape[1], band.shape[2], threads=threads)
        top += band.shape[1]
        yield band
        del band, work  # nothing may hold a band while the next one is made


def read_bands(source: RowSource) -> Iterator[Rows]:
    """Read a source from top to bottom, `BAND_ROWS` at a time."""
    _, height, _ = source.shape
    for top in range(0, height, BAND_ROWS):
        yield source.read(top, min(top + BAND_ROWS, height))


class RollingRows:
    """Bands that arrive from top to bottom, kept only while a reader still needs them.

    Readers know their rows, but the rows know their readers weakly: without a cycle everything is
    freed as soon as the last reader is, and for a reader that is gone nothing is kept.
    """

    def __init__(self, shape: tuple[int, int, int], bands: Iterator[Rows]) -> None:
        self.shape = shape
        self._bands = bands
        self._bands_read: list[tuple[int, Rows]] = []
        self._end = 0
        self._readers: list[weakref.ref[RowReader]] = []

    def reader(self) -> "RowReader":
        """Return a new reader; make all readers before the first one reads."""
        reader = RowReader(self)
        self._readers.append(weakref.ref(reader))
        return reader

    def pieces_for(self, reader: "RowReader", top: int, bottom: int) -> list[Rows]:
        """Return rows to one of the readers; `RowReader.read` says what is refused."""
        if not 0 <= top < bottom <= self.shape[1]:
            raise ContractError(f"rows {top}..{bottom} lie outside 0..{self.shape[1]}")
        if top < reader.top:
            raise ContractError(f"rows are read downwards; got {top} after {reader.top}")
        reader.top = top
        living = [other for reference in self._readers if (other := reference()) is not None]
        first_row = min(other.top for other in living)
        self._bands_read = [
            _without_stale(y, b, first_row)
            for y, b in self._bands_read
            if y + b.shape[1] > first_row
        ]
        while self._end < bottom:
            band = next(self._bands, None)
            if band is None:
                raise ContractError(f"row {bottom} asked for, but the bands end at {self._end}")
            if self._end + band.shape[1] > first_row:
                self._bands_read.append((self._end, band))
            self._end += band.shape[1]
        pieces = [b[:, max(top - y, 0) : bottom - y] for y, b in self._bands_read if y < bottom]
        return [p for p in pieces if p.shape[1]]


def _without_stale(top: int, band: Rows, first_row: int) -> tuple[int, Rows]:
    """Copy the rows that are still needed, if so many are not that the band is worth freeing."""
    stale = first_row - top
    if stale < max(STALE_ROWS, band.shape[1] // 2):
        return top, band
    return first_row, band[:, stale:].copy()


class RowReader:
    """One reader of `RollingRows`; it never moves back.

    Attributes:
        top: First row of its last reading.
    """

    def __init__(self, rows: RollingRows) -> None:
        self._rows = rows
        self.top = 0

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w) of the whole picture."""
        return self._rows.shape

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (channel, bottom - top, w).

        Raises:
            ContractError: If the rows lie outside the picture or above an earlier read.
        """
        pieces = self.pieces(top, bottom)
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces, axis=1)

    def pieces(self, top: int, bottom: int) -> list[Rows]:
        """Return the same rows as they lie, in consecutive pieces."""
        return self._rows.pieces_for(self, top, bottom)


class RowsMadeWhole:
    """A picture that is made whole when its first row is asked for."""

    def __init__(self, shape: tuple[int, int, int], make: Callable[[], Rows]) -> None:
        """Store the way it is made.

        Args:
            shape: (channel, h, w).
            make: Gives it; called once.
        """
        self.shape = shape
        self._make = make
        self._rows: Rows | None = None

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as a view."""
        if self._rows is None:
            self._rows = self._make()
        return self._rows[:, top:bottom]
