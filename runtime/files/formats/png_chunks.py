"""The chunks of a PNG, walked without decoding.

Reference: PNG, third edition, 5.3 (chunk layout), 11.
"""

from collections.abc import Iterator
from typing import Final

from camkit.errors import DecodeError
from camkit.runtime.files.raw_checks import MAX_PIXELS

MAGIC: Final = b"\x89PNG\r\n\x1a\n"
_MOST_CHUNKS: Final = 65_536
_MOST_PX_PER_BYTE: Final = 8192
"""Deflate packs 1032 bytes into one, each of up to 8 pixels."""


def png_chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield name and content of each chunk but those of pixels, as far as they can be followed."""
    at = len(MAGIC)
    for _ in range(_MOST_CHUNKS):
        length, name = int.from_bytes(data[at : at + 4]), data[at + 4 : at + 8]
        if len(name) < 4 or at + 8 + length > len(data):
            return
        if name != b"IDAT":
            yield name, data[at + 8 : at + 8 + length]
        at += 12 + length


def check_png_size(data: bytes) -> None:
    """Refuse a PNG whose header claims more than the file can hold.

    Raises:
        DecodeError: If it does.
    """
    header = next((content for name, content in png_chunks(data) if name == b"IHDR"), b"")
    wide, high = int.from_bytes(header[:4]), int.from_bytes(header[4:8])
    if wide * high > min(MAX_PIXELS, len(data) * _MOST_PX_PER_BYTE):
        raise DecodeError(f"the header claims {wide}x{high} pixels in {len(data)} bytes")
