"""Kernels in pictures: PNG, TIFF with one page or many, EXR; samples as they are stored."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import tifffile
from numpy.typing import NDArray

from camkit.errors import DecodeError
from camkit.runtime.files.formats.tiff_picture import INSIDE_TIFFFILE
from camkit.runtime.files.picture import read_samples

TIFF: Final = (".tif", ".tiff")
SUFFIXES: Final = (".png", *TIFF, ".exr")


def read_kernels(path: Path) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Read (h, w) or (3, h, w) of a picture, (page, ...) of many pages, and notes.

    Raises:
        DecodeError: If the file is damaged or of a kind that is not read.
    """
    if path.suffix.lower() in TIFF:
        pages = _pages(path)
        if pages is not None:
            return pages, ()
    decoded = read_samples(path)
    if 0 < decoded.top <= 255:
        note = "8 bits: read as linear light in 255 steps; 16 bits or floats state faint light too"
        return decoded.samples, (note,)
    return decoded.samples, ()


def _pages(path: Path) -> NDArray[Any] | None:
    """Return the pages of a stack; None where there is one."""
    try:
        with tifffile.TiffFile(path) as file:
            if len(file.pages) == 1 and len(file.series[0].shape) <= 3:
                return None
            return np.asarray(file.asarray())
    except INSIDE_TIFFFILE as error:
        raise DecodeError(f"{path.name} is no sound TIFF: {error}") from error
