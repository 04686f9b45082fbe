"""Products as float pictures: one, or a sequence in one file (parts of an EXR, pages of a TIFF)."""

from pathlib import Path
from typing import Final

import numpy as np
import OpenEXR
import tifffile
from numpy.typing import NDArray

BIGTIFF_BYTES: Final = 2**32 - 2**20


def write_exr(path: Path, frames: NDArray[np.floating], channel: str) -> None:
    """Write float32 planes (n, h, w), each a part of its own, ZIP.

    Args:
        path: The file.
        frames: What they hold; NaN stays.
        channel: Name: Z for depth, Y for photons.
    """
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part(
            dict(header), {channel: np.ascontiguousarray(frame, np.float32)}, f"{number:05d}"
        )
        for number, frame in enumerate(frames)
    ]
    OpenEXR.File(parts).write(str(path))


def write_tiff(path: Path, frames: NDArray[np.floating]) -> None:
    """Write float32 planes (n, h, w), each a page of its own; NaN stays."""
    whole = np.asarray(frames, np.float32)
    tifffile.imwrite(
        path, whole, photometric="minisblack", bigtiff=whole.nbytes > BIGTIFF_BYTES, metadata=None
    )
