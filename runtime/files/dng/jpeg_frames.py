"""The size that the JPEG of a strip or tile states of itself, beside that of the header.

LibRaw puts the samples of a JPEG where the header says, whatever their number. A lossless JPEG may
fold the same number of samples into other columns and components (DNG specification 1.7.1, ch. 3).
"""

import math
import struct
from pathlib import Path
from typing import BinaryIO, Final

from camkit.runtime.files.dng.picture_tags import LOSSY_JPEG, DngPicture, first_of, numbers_of
from camkit.runtime.files.formats.jpeg_segments import FRAMES, MAGIC, header_segments

LOSSLESS_JPEG: Final = 7
MOST_CHUNKS: Final = 256
_MOST_HEAD_BYTES: Final = 65_536
_SIZES: Final = struct.Struct(">BHHB")


def frame_doubt(path: Path, picture: DngPicture) -> str:
    """Return the strip or tile with a wrong number of samples; empty for none.

    Args:
        path: The file.
        picture: Its sensor picture; of any compression.

    Raises:
        OSError: If the file cannot be read.
    """
    tags = picture.directory
    if picture.compression not in (LOSSLESS_JPEG, LOSSY_JPEG):
        return ""
    tiled = 324 in tags
    wide = int(first_of(tags, 322, picture.width)) if tiled else picture.width
    tall = int(first_of(tags, 323 if tiled else 278, picture.height))
    tall = tall if tiled else min(tall, picture.height)
    if min(wide, tall) < 1:
        return ""
    offsets = numbers_of(tags, 324 if tiled else 273)
    counts = numbers_of(tags, 325 if tiled else 279)
    empty = {number for number, count in enumerate(counts) if count == 0}
    per_row = math.ceil(picture.width / wide)
    with path.open("rb") as file:
        for number, offset in enumerate(offsets[:MOST_CHUNKS]):
            if number in empty:
                continue
            frame = _frame(file, int(offset))
            top, left = number // per_row * tall, number % per_row * wide
            # the last ones may be cut to the picture
            sizes = {
                rows * columns * picture.planes
                for rows in (tall, picture.height - top)
                for columns in (wide, picture.width - left)
            }
            if frame == (0, 0, 0):
                return "no JPEG lies in a strip or tile that should be one"
            if frame is not None and math.prod(frame) not in sizes:
                height, width, planes = frame
                return (
                    f"a JPEG of {width}x{height} pixels and {planes} sample(s) lies in a strip or "
                    f"tile of {wide}x{tall} and {picture.planes}"
                )
    return ""


def _frame(file: BinaryIO, offset: int) -> tuple[int, int, int] | None:
    """Return height, width and components of the JPEG at an offset.

    Returns:
        None if it states none; zeros if there is no JPEG.
    """
    file.seek(offset)
    head = file.read(_MOST_HEAD_BYTES)
    if not head.startswith(MAGIC):
        return 0, 0, 0
    for segment in header_segments(head):
        if segment.marker in FRAMES and len(segment.content) >= _SIZES.size:
            _, height, width, planes = _SIZES.unpack_from(segment.content)
            return (height, width, planes) if height * width * planes else None
    return None
