"""Memory that a variable of a MATLAB 5 file takes, found before it is read.

A file of some kilobytes may hold cells of gigabytes of zeros, packed, and cells in cells without an
end. So every element of the variable is passed by in small pieces, and what it would unpack to is
counted; nothing is kept. Elements that do not fit into one another, or are of a type that there is
not, are refused here: scipy believes them.

References: MathWorks, MAT-File Format, level 5.
"""

import struct
import zlib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

from camkit.errors import DecodeError

HEADER_BYTES: Final = 128
MATRIX: Final = 14
PACKED: Final = 15
CELL: Final = 1
OBJECT: Final = 3
STRUCTS: Final = frozenset({2, OBJECT})
NUMBER_BYTES: Final = {6: 8, 7: 4, 8: 1, 9: 1, 10: 2, 11: 2, 12: 4, 13: 4, 14: 8, 15: 8}
"""Class of an array of numbers -> bytes of one."""
NUMBER_TYPES: Final = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18})
"""Types of elements that hold numbers or letters."""
TEXT: Final = 4
SPARSE: Final = 5
PLAIN_CLASSES: Final = frozenset({*NUMBER_BYTES, TEXT, SPARSE})
"""Classes of arrays of numbers and of text."""
TEXT_TIMES: Final = 4
"""Of the bytes of anything else: text becomes UTF-32."""
OBJECT_BYTES: Final = 200
"""Of an array beside its numbers."""
COMPLEX: Final = 0x800
LOGICAL: Final = 0x200
CLASSES: Final = dict(
    enumerate(
        (
            *("cell", "struct", "object", "char", "sparse", "double", "single", "int8", "uint8"),
            *("int16", "uint16", "int32", "uint32", "int64", "uint64", "function", "opaque"),
        ),
        start=1,
    )
)
Listed = tuple[str, tuple[int, ...], str]
"""Name, shape and class of a variable."""
MOST_DEPTH: Final = 8
PIECE: Final = 1 << 16


def is_version_5(path: Path) -> bool:
    """Return whether a file says that it is MATLAB 5."""
    with path.open("rb") as file:
        return file.read(HEADER_BYTES)[-4:] in (b"\x00\x01IM", b"\x01\x00MI")


def listed_variables(path: Path) -> list[Listed]:
    """Return name, shape and class of every variable of a MATLAB 5 file, in little memory.

    scipy unpacks 128 kB of a packed variable at once to list it, up to 130 MB.

    Raises:
        DecodeError: If it is cut off, or a name or shape is none.
    """
    listed: list[Listed] = []
    _walked(path, (), 0, listed)
    return listed


def bytes_of(path: Path, names: Collection[str], most_bytes: int) -> int:
    """Return the memory that some variables of a MATLAB 5 file take together.

    Args:
        path: The file.
        names: Of the variables.
        most_bytes: Counting ends beyond.

    Raises:
        DecodeError: If it is cut off, or cells lie too deep in one another.
    """
    return _walked(path, names, most_bytes, [])


def _walked(path: Path, names: Collection[str], most_bytes: int, listed: list[Listed]) -> int:
    total = 0
    with path.open("rb") as file:
        end = "<" if file.read(HEADER_BYTES)[-2:] == b"IM" else ">"
        while total <= most_bytes and len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(f"{end}II", tag)
            begin = file.tell()
            try:
                if kind == PACKED:
                    walk = _Walk(_Unpacked(file, size), end, most_bytes - total, listed)
                    kind, size = walk.tag()
                else:
                    walk = _Walk(_Plain(file), end, most_bytes - total, listed)
                if kind == MATRIX:
                    total += walk.matrix(size, 0, names)
            except (EOFError, zlib.error) as error:
                raise DecodeError(f"{path.name} is damaged: {error}") from error
            except _DeepError as error:
                raise DecodeError(
                    f"{path.name} nests cells or structures more than {MOST_DEPTH} deep"
                ) from error
            file.seek(begin + struct.unpack(f"{end}I", tag[4:])[0])
    return total


class _DeepError(Exception):
    """Cells lie too deep in one another."""


class _Plain:
    """Bytes as they lie in the file."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def read(self, count: int) -> bytes:
        return self._file.read(count)


class _Unpacked:
    """Bytes of a packed element, unpacked so many at once as are asked for."""

    def __init__(self, file: IO[bytes], size: int) -> None:
        self._file, self._bytes_left, self._unpack = file, size, zlib.decompressobj()

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count and not self._unpack.eof:
            packed = self._unpack.unconsumed_tail
            if not packed:
                packed = self._file.read(min(self._bytes_left, PIECE))
                self._bytes_left -= len(packed)
            more = self._unpack.decompress(packed, count - len(data))
            if not more and not packed:
                break
            data += more
        return data


@dataclass(slots=True)
class _Walk:
    """A way past the elements of a variable.

    Attributes:
        source: Where bytes come from.
        end: Order of bytes, as `struct` names it.
        bytes_left: Bytes of memory that may still be counted.
        listed: Where variables are put down.
    """

    source: _Plain | _Unpacked
    end: str
    bytes_left: int
    listed: list[Listed]

    def tag(self) -> tuple[int, int]:
        """Read type and bytes of an element that is no small one."""
        return struct.unpack(f"{self.end}II", self._read(8))

    def matrix(self, size: int, depth: int, names: Collection[str] | None) -> int:
        """Skip an array; return its bytes, 0 for a variable that is not meant."""
        if depth > MOST_DEPTH:
            raise _DeepError
        if size == 0:
            return OBJECT_BYTES
        (flags,) = struct.unpack(f"{self.end}8xI4x", self._read(16))
        kind, start = flags & 0xFF, 16
        shape_bytes, shape = self._element()
        name_bytes, name = self._element()
        rest = size - start - shape_bytes - name_bytes
        sides = struct.unpack(f"{self.end}{len(shape) // 4}i", shape[: len(shape) // 4 * 4])
        if names is not None:
            own_name = name.decode("latin-1")
            own_class = "logical" if flags & LOGICAL else CLASSES.get(kind, "unknown")
            self.listed.append((own_name, sides, own_class))
            if own_name not in names:
                return 0
        count = 1
        for side in sides:
            count *= max(side, 0)
        if min(sides, default=0) < 0 or rest < 0:
            raise EOFError("an array is larger than what holds it, or has no shape")
        if kind == CELL or kind in STRUCTS:
            return self._inner(kind, count, depth, rest)
        memory_bytes = OBJECT_BYTES + max(rest, 0) * TEXT_TIMES
        if kind in NUMBER_BYTES:
            memory_bytes = OBJECT_BYTES + count * NUMBER_BYTES[kind] * (2 if flags & COMPLEX else 1)
        self._counted(memory_bytes)
        if kind in PLAIN_CLASSES:
            rest -= self._numbers(rest, (3 if kind == SPARSE else 1) + bool(flags & COMPLEX))
        self._skip(rest)
        return memory_bytes

    def _numbers(self, size: int, elements: int) -> int:
        """Skip the elements of an array of numbers; return how many of its bytes they took."""
        bytes_read = 0
        for _ in range(elements):
            kind, length = self.tag()
            is_small = kind >> 16
            if (kind & 0xFFFF) not in NUMBER_TYPES or is_small > 4:
                raise EOFError(f"numbers of the unknown type {kind}")
            padded = 0 if is_small else -(-length // 8) * 8
            bytes_read += 8 + padded
            if bytes_read > size:
                raise EOFError("numbers are more than their array holds")
            self._skip(padded)
        return bytes_read

    def _inner(self, kind: int, count: int, depth: int, rest: int) -> int:
        """Skip the arrays in a cell or a structure."""
        total = self._counted(OBJECT_BYTES)
        if kind == OBJECT:
            self._element()  # the class of an object
        if kind in STRUCTS:
            _, length = self._element()
            _, fields = self._element()
            (wide,) = struct.unpack(f"{self.end}i", length[:4].ljust(4, b"\0"))
            count *= len(fields) // max(wide, 1)
        if 8 * count > rest:
            raise EOFError("cells are fewer than their shape says")
        for _ in range(count):
            kind, size = self.tag()
            total += self._counted(8)
            if kind != MATRIX:
                raise EOFError(f"a cell of the type {kind}, which is no array")
            total += self.matrix(size, depth + 1, None)
            if self.bytes_left < 0:
                break
        return total

    def _counted(self, size: int) -> int:
        self.bytes_left -= size
        return size

    def _element(self) -> tuple[int, bytes]:
        """Read a short element whole; return how many bytes it took, and what it holds."""
        head = self._read(8)
        kind, size = struct.unpack(f"{self.end}II", head)
        if kind >> 16:  # a small one: its bytes lie in the tag
            return 8, head[4 : 4 + min(kind >> 16, 4)]
        if size > PIECE * 16:
            raise EOFError(f"a name or shape of {size} bytes")
        padded = -(-size // 8) * 8
        return 8 + padded, self._read(padded)[:size]

    def _read(self, count: int) -> bytes:
        data = self.source.read(count)
        if len(data) < count:
            raise EOFError("it is cut off")
        return data

    def _skip(self, count: int) -> None:
        """Skip bytes; beyond the memory there is no need to go on."""
        while count > 0 and self.bytes_left >= 0:
            count -= len(self._read(min(count, PIECE)))
