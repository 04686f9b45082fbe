"""The chunks of a PNG, walked without decoding.

Reference: PNG, third edition, 5.3 (chunk layout), 11.
"""

from collections.abc import Iterator
from typing import Final

MAGIC: Final = b"\x89PNG\r\n\x1a\n"
_MOST_CHUNKS: Final = 65_536


def png_chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Return name and content of each chunk but those of pixels, as far as they can be followed."""
    at = len(MAGIC)
    for _ in range(_MOST_CHUNKS):
        length, name = int.from_bytes(data[at : at + 4]), data[at + 4 : at + 8]
        if len(name) < 4 or at + 8 + length > len(data):
            return
        if name != b"IDAT":
            yield name, data[at + 8 : at + 8 + length]
        at += 12 + length
