"""Directories of TIFF files (TIFF 6.0, section 2; BigTIFF), laid out by Pillow.

EXIF is a TIFF structure too, wherever it stands; one way of writing serves all.
"""

from collections.abc import Mapping
from enum import IntEnum
from fractions import Fraction
from typing import Any, Final

STRIP_OFFSETS: Final = 273


class Kind(IntEnum):
    """The types of values that camkit writes."""

    BYTE = 1
    ASCII = 2
    SHORT = 3
    LONG = 4
    RATIONAL = 5
    UNDEFINED = 7
    SRATIONAL = 10
    DOUBLE = 12
    LONG8 = 16


Tags = Mapping[int, tuple[Kind, Any]]
"""Tag -> type and value: bytes for BYTE, ASCII and UNDEFINED, else a number or a tuple of them."""


def header_bytes(first: int, *, big: bool = False) -> bytes:
    """Return the start of a little-endian file whose first directory lies at `first`."""
    if big:
        return b"II+\0\x08\0\0\0" + first.to_bytes(8, "little")
    return b"II*\0" + first.to_bytes(4, "little")


def directory_bytes(tags: Tags, offset: int, *, big: bool = False) -> bytes:
    """Return a directory with the values that it points at.

    Args:
        tags: What it holds. The offset of its strip counts from the start of the file, and the
            strip lies behind the directory.
        offset: Where the directory lies in the file.
        big: BigTIFF.
    """
    directory = _directory(tags, big=big)
    if STRIP_OFFSETS in tags:
        # Pillow counts the strip from the end of what it lays out
        end = offset + directory_length(tags, big=big)
        directory[STRIP_OFFSETS] = tags[STRIP_OFFSETS][1] - end
    return bytes(directory.tobytes(offset))


def directory_length(tags: Tags, *, big: bool = False) -> int:
    """Return the length of a directory, which does not depend on what its numbers are."""
    return len(_directory(tags, big=big).tobytes(0))


def _directory(tags: Tags, *, big: bool) -> Any:
    """Return Pillow's directory, its strip at the start of the file."""
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    directory = ImageFileDirectory_v2(header_bytes(0, big=big))
    for tag, (kind, value) in tags.items():
        directory.tagtype[tag] = int(kind)
        content = _rationals(value) if kind in {Kind.RATIONAL, Kind.SRATIONAL} else value
        directory[tag] = 0 if tag == STRIP_OFFSETS else content
    return directory


def _rationals(value: Any) -> Any:
    from PIL.TiffImagePlugin import IFDRational

    if isinstance(value, tuple):
        return tuple(_rationals(v) for v in value)
    exact = Fraction(value)
    return IFDRational(exact.numerator, exact.denominator)
