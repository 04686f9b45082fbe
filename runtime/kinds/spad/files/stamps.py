"""Time stamps of photons, pixel by pixel, sorted into bins when rows are asked for."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError, DecodeError
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.files.counts_file import ARRIVALS, CountsFile, checked_size

AT_ONCE: Final = 500_000
"""Stamps that are sorted at once."""


class StampsFile(CountsFile):
    """The stamps of every pixel."""

    def __init__(
        self,
        path: Path,
        shape: tuple[int, int],
        cells: Callable[[int], Sequence[NDArray[Any]]],
        *,
        stated_times: Mapping[str, object] | None = None,
        close: Callable[[], None] | None = None,
    ) -> None:
        """Store the stamps of all pixels.

        Args:
            path: Where they came from.
            shape: (h, w).
            cells: Row -> the stamps of each of its pixels, arrays of any shape.
            stated_times: What the file says of their times.
            close: Lets go of what they lie in.
        """
        self.path, self.kind, self.bins = path, "stamps", 0
        self.height, self.width = checked_size(path, *shape)
        self.stated_times, self.assumed, self._close = stated_times or {}, ARRIVALS, close
        self._cells = cells
        self._outside: dict[int, int] = {}

    def rows(self, top: int, bottom: int, edges: NDArray[np.float64] | None = None) -> FloatArray:
        """Sort the stamps of some rows; see `CountsFile`."""
        if edges is None:
            raise ContractError("time stamps need the edges of bins")
        histograms = np.empty((bottom - top, self.width, len(edges) - 1), np.float32)
        for y in range(top, bottom):
            counts = np.zeros(self.width * (len(edges) - 1), np.int64)
            outside = 0
            for pixels, stamps in self._pieces(y):
                at = np.searchsorted(edges, stamps, side="right") - 1
                inside = (at >= 0) & (at < len(edges) - 1)
                outside += int((~inside).sum())
                flat = pixels[inside] * (len(edges) - 1) + at[inside]
                counts += np.bincount(flat, minlength=len(counts))
            self._outside[y] = outside
            histograms[y - top] = counts.reshape(self.width, -1)
        return histograms

    def _pieces(self, y: int) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64]]]:
        """Yield the stamps of a row with their pixels, as many at once as need little memory."""
        cells = [np.ravel(cell) for cell in self._cells(y)]
        ends = np.cumsum([cell.size for cell in cells])
        begins = ends - [cell.size for cell in cells]
        for start in range(0, int(ends[-1]), AT_ONCE):
            check_wish()
            end = min(start + AT_ONCE, int(ends[-1]))
            some = [
                (x, cells[x][max(start - begins[x], 0) : end - begins[x]])
                for x in np.flatnonzero((begins < end) & (ends > start))
            ]
            pixels = np.repeat([x for x, _ in some], [part.size for _, part in some])
            yield pixels, np.concatenate([_numbers(self.path, part) for _, part in some])

    @property
    def outside(self) -> int:
        """Return how many stamps of the rows read so far lay outside all bins."""
        return sum(self._outside.values())

    def close(self) -> None:
        """Release what they lie in."""
        if self._close is not None:
            self._close()


def _numbers(path: Path, cell: NDArray[Any]) -> NDArray[np.float64]:
    if cell.size and cell.dtype.kind not in "biuf":
        raise DecodeError(f"{path.name}: a cell holds {cell.dtype}; expected time stamps")
    stamps = cell.astype(np.float64) if cell.size else np.empty(0)
    if bad := int(stamps.size - np.count_nonzero(np.isfinite(stamps))):
        raise DecodeError(
            f"{path.name} holds time stamps that are not finite: {bad} of the {stamps.size} of a "
            "pixel; expected numbers"
        )
    return np.asarray(stamps)
