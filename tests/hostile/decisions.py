"""Choices read from a string of bytes: the same bytes always choose the same.

The seeded cases give bytes of a random generator, the fuzzer bytes that reached new code. Where
they end, every choice is the first.
"""

from collections.abc import Sequence
from typing import TypeVar

_T = TypeVar("_T")


class Decisions:
    """Reads choices off bytes."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def raw(self, count: int) -> bytes:
        """Give the next bytes, zeros behind the end."""
        part = self._data[self._at : self._at + count]
        self._at += count
        return part.ljust(count, b"\0")

    def index(self, count: int) -> int:
        """Give a number from 0 to count - 1."""
        return int.from_bytes(self.raw(1 if count <= 256 else 4), "little") % count

    def pick(self, options: Sequence[_T]) -> _T:
        """Give one of several."""
        return options[self.index(len(options))]

    def coin(self) -> bool:
        """Give yes or no."""
        return bool(self.index(2))
