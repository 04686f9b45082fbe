"""In how many rows at once a capture is worked through, under a cap of memory."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from camkit.caller import option_text
from camkit.errors import MemoryCapError

KEPT_BYTES: Final = 260_000_000
"""What the process needs beside its rows."""
BYTES_OF_COUNT: Final = 32
"""What a count of a strip takes, with all that is made of it in between."""
MOST_COUNTS: Final = 12_000_000
"""Of a strip: more rows at once make nothing faster."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Some rows, with those around that bear on them.

    Attributes:
        top: First row that is asked for.
        bottom: The one after the last.
        first: First row that is read.
        end: The one after the last that is read.
    """

    top: int
    bottom: int
    first: int
    end: int

    @property
    def core(self) -> slice:
        """Return the rows that are asked for among those that are read."""
        return slice(self.top - self.first, self.bottom - self.first)


def pieces(
    shape: tuple[int, int], bins: int, *, reach: int, max_mem_bytes: int, held_bytes: int
) -> list[Piece]:
    """Cut an array into pieces.

    Args:
        shape: (h, w).
        bins: Counts of a pixel.
        reach: Rows above and below that bear on a row.
        max_mem_bytes: Memory that the process may take.
        held_bytes: What of it all products together take.

    Raises:
        MemoryCapError: If not even one row fits.
    """
    height, width = shape
    free = max_mem_bytes - KEPT_BYTES - held_bytes
    of_row = width * bins
    rows = min(free // BYTES_OF_COUNT, MOST_COUNTS) // of_row - 2 * reach
    least = of_row * BYTES_OF_COUNT * min(height, 2 * reach + 1)
    if free < least:
        need = KEPT_BYTES + held_bytes + least
        raise MemoryCapError(
            f"{width}x{height} pixels of {bins} bins need "
            f"{option_text('max_mem_bytes', need)}; the cap "
            f"is {max_mem_bytes // 10**6}M",
            need,
        )
    return list(_cut(height, max(rows, 1), reach))


def check_room(shape: tuple[int, int], bins: int, of_count: int, max_mem_bytes: int) -> None:
    """Refuse what has to be held as a whole and does not fit.

    Args:
        shape: (h, w).
        bins: Counts of a pixel.
        of_count: Bytes that a count takes.
        max_mem_bytes: Memory that the process may take.

    Raises:
        MemoryCapError: Says how much it needs.
    """
    need = KEPT_BYTES + of_count * shape[0] * shape[1] * bins
    if need > max_mem_bytes:
        raise MemoryCapError(
            f"{shape[1]}x{shape[0]} pixels of {bins} bins on the fine grid of a bundle need "
            f"{option_text('max_mem_bytes', need)}; the cap is {max_mem_bytes // 10**6}M",
            need,
        )


def _cut(height: int, rows: int, reach: int) -> Iterator[Piece]:
    count = -(-height // rows)
    for number in range(count):
        top, bottom = number * height // count, (number + 1) * height // count
        yield Piece(
            top=top, bottom=bottom, first=max(0, top - reach), end=min(height, bottom + reach)
        )
