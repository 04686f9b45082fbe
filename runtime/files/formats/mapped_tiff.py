"""Large plain TIFF files read in place: rows come from the file when a stage asks for them.

A sensor of 400 megapixels fills 0.8 GB as a mosaic and 2.4 GB as RGB; decoded twice over, as
libraries do, it would not fit in the memory that the whole reconstruction needs.
"""

import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

LEAST_BYTES: Final = 128_000_000
"""Smaller files are decoded as all others are."""

_MAGIC: Final = {"little": (b"II*\0", b"II+\0"), "big": (b"MM\0*", b"MM\0+")}
_PLAIN_PHOTOMETRIC: Final = (1, 2)  # black is zero, RGB


def map_plain_tiff(path: Path, *, least_bytes: int = LEAST_BYTES) -> NDArray[Any] | None:
    """Map the samples of an uncompressed TIFF whose rows lie one after the other.

    Args:
        path: Any file; its tags have been checked against its length.
        least_bytes: Size from which on mapping is worth it.

    Returns:
        (h, w) or (h, w, 3), uint8 or uint16, read-only; None for any other file.
    """
    with path.open("rb") as file:
        if file.read(4) not in _MAGIC[sys.byteorder] or path.stat().st_size < least_bytes:
            return None
    import tifffile

    try:
        with tifffile.TiffFile(path) as tiff:
            page = tiff.pages[0]
            if not _is_plain(page):
                return None
            offset, shape, dtype = page.dataoffsets[0], page.shape, page.dtype
    except (tifffile.TiffFileError, ValueError, IndexError):
        return None  # OpenCV's decoder says what is wrong with it
    return np.memmap(path, dtype=dtype, mode="r", offset=offset, shape=shape)


def _is_plain(page: Any) -> bool:
    shape = page.shape
    return bool(
        page.is_memmappable
        and page.dtype in (np.uint8, np.uint16)
        and page.photometric in _PLAIN_PHOTOMETRIC
        and (len(shape) == 2 or (len(shape) == 3 and shape[2] == 3))
    )
