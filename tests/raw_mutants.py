"""Damaged copies of RAW files, made by a seeded generator: the same seed gives the same copies.

    bytes of a sound file -> Mutator -> Mutant (bytes, what was done to them)

Tags are found by tifffile, so that the copies do not depend on the reader under test.
"""

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import tifffile

EDITED_TAGS: Final = {
    254: "NewSubfileType", 256: "ImageWidth", 257: "ImageLength", 258: "BitsPerSample",
    259: "Compression", 262: "PhotometricInterpretation", 273: "StripOffsets",
    277: "SamplesPerPixel", 278: "RowsPerStrip", 279: "StripByteCounts", 322: "TileWidth",
    323: "TileLength", 324: "TileOffsets", 325: "TileByteCounts", 33421: "CFARepeatPatternDim",
    33422: "CFAPattern", 50706: "DNGVersion", 50711: "CFALayout", 50712: "LinearizationTable",
    50713: "BlackLevelRepeatDim", 50714: "BlackLevel", 50717: "WhiteLevel",
    50718: "DefaultScale", 50719: "DefaultCropOrigin", 50720: "DefaultCropSize",
    50829: "ActiveArea", 50830: "MaskedAreas",
}  # fmt: skip
HEAD_BYTES: Final = 4096
_SIZES: Final = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8}
_WHOLE: Final = {1: "B", 3: "H", 4: "I", 5: "I", 8: "h", 9: "i", 10: "i"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
    """One damaged copy.

    Attributes:
        source: Name of the sound file.
        kind: Class of the damage, a method of `Mutator`.
        detail: What exactly was changed.
        data: The bytes of the copy.
    """

    source: str
    kind: str
    detail: str
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class _Entry:
    """One tag of a file and where its bytes lie."""

    tag: int
    type: int
    count: int
    value_at: int
    entry_at: int

    @property
    def value_bytes(self) -> int:
        return _SIZES.get(self.type, 1) * self.count


class Mutator:
    """Makes damaged copies of one file."""

    def __init__(self, path: Path) -> None:
        self.name = path.name
        self._data = path.read_bytes()
        self._order, entries = _entries(self._data)
        self._entries = entries
        self._edited = [entry for entry in entries if entry.tag in EDITED_TAGS]

    @property
    def kinds(self) -> tuple[str, ...]:
        """Name what can be done to this file."""
        common = ("head_bytes", "data_bytes", "cut", "swapped", "zeroed", "shifted")
        tags = ("tag_value",) * 6 + ("tag_entry", "tag_entry", "tag_bytes")
        return (*common, *(tags if self._edited else ("tail_bytes",) * 3))

    def mutants(self, count: int, seed: int) -> Iterator[Mutant]:
        """Give damaged copies, their kinds in turn."""
        kinds = self.kinds
        for number in range(count):
            rng = np.random.default_rng((seed, number))
            kind = kinds[number % len(kinds)]
            data = bytearray(self._data)
            detail = getattr(self, "_" + kind)(data, rng)
            yield Mutant(source=self.name, kind=kind, detail=detail, data=bytes(data))

    def _head_bytes(self, data: bytearray, rng: np.random.Generator) -> str:
        return _flip(data, rng, 4, min(HEAD_BYTES, len(data)), int(rng.integers(1, 25)))

    def _tail_bytes(self, data: bytearray, rng: np.random.Generator) -> str:
        return _flip(data, rng, len(data) - HEAD_BYTES, len(data), int(rng.integers(1, 9)))

    def _data_bytes(self, data: bytearray, rng: np.random.Generator) -> str:
        return _flip(data, rng, HEAD_BYTES, len(data), int(rng.integers(1, 257)))

    def _cut(self, data: bytearray, rng: np.random.Generator) -> str:
        kept = int(rng.integers(16, len(data)))
        del data[kept:]
        return f"first {kept} bytes"

    def _swapped(self, data: bytearray, rng: np.random.Generator) -> str:
        size, (first, second) = _block(data, rng), (0, 0)
        while abs(first - second) < size:
            first, second = (int(n) for n in rng.integers(0, len(data) - size, 2))
        one, two = data[first : first + size], data[second : second + size]
        data[first : first + size], data[second : second + size] = two, one
        return f"{size} bytes at {first} and {second}"

    def _zeroed(self, data: bytearray, rng: np.random.Generator) -> str:
        size = _block(data, rng)
        at = int(rng.integers(HEAD_BYTES, len(data) - size))
        data[at : at + size] = bytes(size)
        return f"{size} bytes at {at}"

    def _shifted(self, data: bytearray, rng: np.random.Generator) -> str:
        at, size = int(rng.integers(16, len(data))), int(rng.integers(1, 5000))
        if rng.random() < 0.5:
            del data[at : at + size]
            return f"{size} bytes lost at {at}"
        data[at:at] = rng.bytes(size)
        return f"{size} bytes put in at {at}"

    def _tag_bytes(self, data: bytearray, rng: np.random.Generator) -> str:
        entry = self._entries[int(rng.integers(len(self._entries)))]
        return f"tag {entry.tag} " + _flip(data, rng, entry.entry_at, entry.entry_at + 12, 1)

    def _tag_entry(self, data: bytearray, rng: np.random.Generator) -> str:
        """Change number, type, count or address of a tag that matters."""
        entry = self._edited[int(rng.integers(len(self._edited)))]
        part = int(rng.integers(4))
        at, code = entry.entry_at + (0, 2, 4, 8)[part], "HHII"[part]
        new = int(rng.choice([rng.integers(0, 2**16), 0, 1, 2, 4, rng.integers(0, len(data))]))
        struct.pack_into(self._order + code, data, at, new % 2 ** (8 * struct.calcsize(code)))
        return f"{EDITED_TAGS[entry.tag]} {('number', 'type', 'count', 'address')[part]} {new}"

    def _tag_value(self, data: bytearray, rng: np.random.Generator) -> str:
        """Give one number of a tag that matters another value of the same type."""
        entry = self._edited[int(rng.integers(len(self._edited)))]
        code = _WHOLE.get(entry.type, "B")
        size = struct.calcsize(code)
        at = entry.value_at + size * int(rng.integers(max(entry.value_bytes // size, 1)))
        (old,) = struct.unpack_from(self._order + code, data, at)
        top = 2 ** (8 * size)
        near = (
            old * 2,
            old // 2,
            old + 1,
            old + 2,
            old - 1,
            old ^ (1 << int(rng.integers(8 * size))),
        )
        far = (rng.integers(top), rng.integers(256), 0, top - 1)
        new = int(rng.choice(np.array([*near, *far], dtype=np.int64)))
        signed = code.islower()
        new = (new + top // 2) % top - top // 2 if signed else new % top
        struct.pack_into(self._order + code, data, at, new)
        return f"{EDITED_TAGS[entry.tag]} {old} -> {new}"


def _block(data: bytearray, rng: np.random.Generator) -> int:
    return int(min(2 ** rng.uniform(9, 18), len(data) // 4))


def _flip(data: bytearray, rng: np.random.Generator, first: int, last: int, count: int) -> str:
    places = rng.integers(first, last, count)
    for place in places:
        data[place] ^= int(rng.integers(1, 256))
    return f"{count} byte(s) at {sorted(places.tolist())[:8]}"


def _entries(data: bytes) -> tuple[str, list[_Entry]]:
    """Give byte order and tags of a TIFF-based file; none for others."""
    try:
        tiff = tifffile.TiffFile(io.BytesIO(data))
    except tifffile.TiffFileError:
        return "<", []
    found: list[_Entry] = []
    with tiff:
        pages = list(tiff.pages)
        while pages:
            page = pages.pop(0)
            found += [
                _Entry(
                    tag=tag.code,
                    type=int(tag.dtype),
                    count=tag.count,
                    value_at=tag.valueoffset,
                    entry_at=tag.offset,
                )
                for tag in page.tags
            ]
            pages += list(page.pages or ())
    return tiff.byteorder, found
