"""A JPEG walked from marker to marker, to the end of its picture and no further.

Cameras append films, further pictures and tables behind the end marker; the picture ends where its
last scan does. A scan is followed by its markers alone: within one, FF is always followed by 00 or
by a restart.

References: ISO 10918-1, B.1 (markers), B.2 (the order of segments), F.1.2.3 (byte stuffing).
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from camkit.errors import DecodeError
from camkit.runtime.files.raw_checks import MAX_PIXELS

MAGIC: Final = b"\xff\xd8"
_MOST_SEGMENTS: Final = 65_536
_START_OF_SCAN: Final = 0xDA
_END: Final = 0xD9
FRAMES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_OF_SCANS: Final = frozenset({0xC4, 0xCC, *range(0xDA, 0xE0), *range(0xE0, 0xF0), 0xFE})
"""Markers that may follow a scan: tables, next scan, lines, restarts, applications, comment."""
_ARITHMETIC: Final = (0xC9, 0xCA)
_MOST_PX_PER_BYTE: Final = 1024
"""Huffman codes take a bit or more of every block of 8x8 samples."""
_UNREAD: Final = {
    0xC3: "lossless",
    0xC5: "hierarchical",
    0xC6: "hierarchical",
    0xC7: "hierarchical and lossless",
    0xCB: "lossless and arithmetically coded",
    0xCD: "hierarchical",
    0xCE: "hierarchical",
    0xCF: "hierarchical and lossless",
    0xF7: "JPEG-LS",
}
_MARKER: Final = re.compile(rb"\xff+([^\x00\xd0-\xd7\xff])", re.DOTALL)


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """One segment.

    Attributes:
        marker: Its second byte.
        content: Bytes behind its length.
        end: Where the next begins.
    """

    marker: int
    content: bytes
    end: int


def header_segments(data: bytes) -> Iterator[Segment]:
    """Yield the segments before the first scan, as far as they can be followed."""
    at = len(MAGIC)
    for _ in range(_MOST_SEGMENTS):
        segment = _segment(data, at)
        if segment is None or segment.marker in (_START_OF_SCAN, _END):
            return
        yield segment
        at = segment.end


def end_of_jpeg(data: bytes) -> int:
    """Return the number of bytes of the picture, its end marker included.

    Raises:
        DecodeError: If it is cut off, damaged, or of a kind that is not read; names it.
    """
    at = len(MAGIC)
    for _ in range(_MOST_SEGMENTS):
        segment = _segment(data, at)
        if segment is None:
            break
        if segment.marker == _END:
            return segment.end
        _check_kind(segment, len(data))
        at = segment.end
        if segment.marker == _START_OF_SCAN:
            marker = _MARKER.search(data, at)
            if marker is None:
                break
            if marker[1][0] not in _OF_SCANS | {_END}:
                raise DecodeError(
                    f"the JPEG is damaged: FF{marker[1][0]:02X} at byte {marker.start()} lies "
                    "within a scan; copy the file again"
                )
            at = marker.start()
    raise DecodeError("the JPEG has no end marker: it is cut off, copy it again")


def _segment(data: bytes, at: int) -> Segment | None:
    """Return the segment at a place; None where there is none."""
    while data[at : at + 2] == b"\xff\xff":
        at += 1
    if len(data) < at + 2 or data[at] != 0xFF:
        return None
    marker = data[at + 1]
    if marker == _END or 0xD0 <= marker <= 0xD8 or marker == 1:
        return Segment(marker=marker, content=b"", end=at + 2)
    length = int.from_bytes(data[at + 2 : at + 4])
    if length < 2 or at + 2 + length > len(data):
        return None
    return Segment(marker=marker, content=data[at + 4 : at + 2 + length], end=at + 2 + length)


def _check_kind(segment: Segment, file_bytes: int) -> None:
    kind = _UNREAD.get(segment.marker)
    if kind is not None:
        raise DecodeError(f"a {kind} JPEG is not read; save it as baseline or progressive JPEG")
    if segment.marker not in FRAMES or len(segment.content) < 6:
        return
    bits, channels = segment.content[0], segment.content[5]
    high, wide = int.from_bytes(segment.content[1:3]), int.from_bytes(segment.content[3:5])
    most = MAX_PIXELS if segment.marker in _ARITHMETIC else file_bytes * _MOST_PX_PER_BYTE
    if high * wide > min(MAX_PIXELS, most):
        raise DecodeError(f"the header claims {wide}x{high} pixels in {file_bytes} bytes")
    if bits != 8:
        raise DecodeError(f"a JPEG of {bits} bits is not read; save it with 8 bits, or as PNG")
    if channels == 4:
        raise DecodeError(
            "a CMYK JPEG is not read, since its inks are not light; convert it to RGB"
        )
    if channels not in (1, 3):
        raise DecodeError(f"a JPEG has 1 or 3 channels; got {channels}")
