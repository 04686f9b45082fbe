"""The tags of a TIFF-based file (DNG, ARW, NEF, CR2, KDC ...), read without trusting it.

Every count and offset is bounded, loops of directories end, and a value that lies outside the
file is left out instead of raising: what is missing shows up in the checks that need it. All
directories together have a limit too, since entries may share the bytes they point at.
"""

import io
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Final

TagValue = tuple[float, ...] | bytes

EXIF_POINTER: Final = 34665
GPS_POINTER: Final = 34853
INTEROPERABILITY_POINTER: Final = 40965
INTEROPERABILITY_INDEX: Final = 1
SUB_IFDS: Final = 330
MAX_DIRECTORIES: Final = 64
MAX_ENTRIES: Final = 4096
MAX_VALUE_BYTES: Final = 4 << 20
MAX_ALL_ENTRIES: Final = 16384
MAX_ALL_BYTES: Final = 32 << 20

# TIFF 6.0 section 2 and BigTIFF: type -> (struct code of one number, numbers per value)
_TYPES: Final = {
    1: ("B", 1), 3: ("H", 1), 4: ("I", 1), 5: ("I", 2), 6: ("b", 1), 8: ("h", 1), 9: ("i", 1),
    10: ("i", 2), 11: ("f", 1), 12: ("d", 1), 13: ("I", 1), 16: ("Q", 1), 17: ("q", 1),
    18: ("Q", 1),
}  # fmt: skip
_TEXT_TYPES: Final = (2, 7)


@dataclass(frozen=True, slots=True, kw_only=True)
class TiffTags:
    """The directories of one file in the order found: first IFD, its children, the next IFD.

    Attributes:
        directories: Tag number -> numbers, or bytes for text and opaque values.
        file_bytes: Size of the file.
        starts: Where each directory lies in the file.
        interoperability: Index of Exif's interoperability, such as R03; empty if not stated. Its
            directory is no other, since its numbers of tags are also those of places.
    """

    directories: tuple[Mapping[int, TagValue], ...]
    file_bytes: int
    starts: tuple[int, ...] = ()
    interoperability: str = ""

    def numbers(self, tag: int) -> tuple[float, ...] | None:
        """Return the numbers of a tag from the first directory that has it."""
        for directory in self.directories:
            value = directory.get(tag)
            if value and not isinstance(value, bytes):
                return value
        return None

    def text(self, tag: int) -> str | None:
        """Return the text of a tag from the first directory that has it."""
        for directory in self.directories:
            value = directory.get(tag)
            if isinstance(value, bytes):
                return value.split(b"\0")[0].decode("utf-8", errors="replace").strip()
        return None


@dataclass(slots=True)
class _Reader:
    """Walks one file; `order` and `big` come from its header."""

    file: BinaryIO
    file_bytes: int
    order: str
    big: bool
    entries_left: int = MAX_ALL_ENTRIES
    bytes_left: int = MAX_ALL_BYTES
    visited: set[int] = field(default_factory=set)
    directories: dict[int, Mapping[int, TagValue]] = field(default_factory=dict)
    interoperability: str = ""

    def unpack(self, code: str, offset: int) -> tuple[float, ...] | None:
        """Return numbers at an offset, or None where the file does not reach."""
        size = struct.calcsize(self.order + code)
        if offset < 0 or offset + size > self.file_bytes:
            return None
        self.file.seek(offset)
        data = self.file.read(size)
        return struct.unpack(self.order + code, data) if len(data) == size else None

    def walk(self, offset: int) -> None:
        """Read a chain of directories with their children."""
        pending = [offset]
        while pending and len(self.visited) < MAX_DIRECTORIES:
            at = pending.pop(0)
            if at <= 0 or at in self.visited:
                continue
            self.visited.add(at)
            tags, following = self.directory(at)
            self.directories[at] = tags
            pointers = (SUB_IFDS, EXIF_POINTER, GPS_POINTER)
            children = [at for tag in pointers for at in _whole(tags.get(tag))]
            for place in _whole(tags.get(INTEROPERABILITY_POINTER))[:1]:
                index = self.directory(place)[0].get(INTEROPERABILITY_INDEX)
                if isinstance(index, bytes):
                    self.interoperability = index.split(b"\0")[0].decode("latin-1")
            pending = [*children[:MAX_DIRECTORIES], *pending, following]

    def directory(self, offset: int) -> tuple[dict[int, TagValue], int]:
        """Read one directory; gives its tags and the offset of the next one (0: none)."""
        count_code, entry_bytes, pointer = ("Q", 20, "Q") if self.big else ("H", 12, "I")
        count = self.unpack(count_code, offset)
        tags: dict[int, TagValue] = {}
        if count is None or count[0] > min(MAX_ENTRIES, self.entries_left):
            return tags, 0
        self.entries_left -= int(count[0])
        first = offset + struct.calcsize(self.order + count_code)
        for n in range(int(count[0])):
            entry = self.entry(first + n * entry_bytes, pointer)
            if entry is not None:
                tags.setdefault(*entry)
        following = self.unpack(pointer, first + int(count[0]) * entry_bytes)
        return tags, int(following[0]) if following else 0

    def entry(self, offset: int, pointer: str) -> tuple[int, TagValue] | None:
        """Read one entry; None if its type is unknown or its value is out of bounds."""
        head = self.unpack("HH" + pointer, offset)
        if head is None:
            return None
        tag, kind, count = (int(n) for n in head)
        code, per_value = ("s", 1) if kind in _TEXT_TYPES else _TYPES.get(kind, ("", 0))
        if not code:
            return None
        value_bytes = struct.calcsize(code) * per_value * count
        if not 0 < value_bytes <= min(MAX_VALUE_BYTES, self.bytes_left):
            return None
        self.bytes_left -= value_bytes
        at = offset + 4 + struct.calcsize(self.order + pointer)
        if value_bytes > struct.calcsize(self.order + pointer):
            address = self.unpack(pointer, at)
            at = int(address[0]) if address else -1
        raw = self.unpack(f"{count * per_value}{code}", at)
        if raw is None:
            return None
        return (tag, raw[0]) if code == "s" else (tag, _values(raw, per_value))  # type: ignore[return-value]


def read_tiff_tags(path: Path) -> TiffTags:
    """Read all directories of a file; none if it is not a TIFF (magic 42) or BigTIFF (43).

    Raises:
        OSError: If the file cannot be read at all.
    """
    with path.open("rb") as file:
        return _read(file, path.stat().st_size)


def tags_of_block(block: bytes) -> TiffTags:
    """Read all directories of a TIFF structure in memory, as EXIF is in other files."""
    return _read(io.BytesIO(block), len(block))


def _read(file: BinaryIO, file_bytes: int) -> TiffTags:
    head = file.read(16)
    order = {b"II": "<", b"MM": ">"}.get(head[:2])
    magic = struct.unpack(order + "H", head[2:4])[0] if order and len(head) == 16 else 0
    if order is None or magic not in (42, 43):
        return TiffTags(directories=(), file_bytes=file_bytes)
    reader = _Reader(file=file, file_bytes=file_bytes, order=order, big=magic == 43)
    (first,) = struct.unpack(
        order + ("Q" if reader.big else "I"), head[8:] if reader.big else head[4:8]
    )
    reader.walk(first)
    return TiffTags(
        directories=tuple(reader.directories.values()),
        file_bytes=file_bytes,
        starts=tuple(reader.directories),
        interoperability=reader.interoperability,
    )


def _values(raw: tuple[float, ...], per_value: int) -> tuple[float, ...]:
    if per_value == 1:
        return raw
    pairs = zip(raw[::2], raw[1::2], strict=True)
    return tuple(top / bottom if bottom else float("nan") for top, bottom in pairs)


def _whole(value: TagValue | None) -> list[int]:
    if value is None or isinstance(value, bytes):
        return []
    return [int(n) for n in value if math.isfinite(n)]
