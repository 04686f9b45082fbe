"""TIFF: a page of counts, or a stack whose pages are time."""

import logging
import struct
import zlib
from pathlib import Path
from typing import Any, Final

import numpy as np
import tifffile
from numpy.typing import NDArray

from camkit.errors import CamkitError, DecodeError
from camkit.runtime.kinds.spad.files.array_file import ArrayFile
from camkit.runtime.kinds.spad.files.counts_file import CountsFile, Hints
from camkit.runtime.kinds.spad.files.packed import MOST_UNPACKED

BROKEN: Final = (
    *(tifffile.TiffFileError, ValueError, TypeError, KeyError, IndexError, OSError, EOFError),
    *(RuntimeError, AttributeError, ZeroDivisionError, OverflowError, MemoryError, struct.error),
    zlib.error,
    ImportError,  # a packing that needs a library of its own
)
"""What tifffile raises of files that are damaged, or packed in ways that it does not know."""
logging.getLogger("tifffile").addHandler(logging.NullHandler())


def open_tiff(path: Path, hints: Hints) -> CountsFile:
    """Open a TIFF; see `open_counts`."""
    try:
        with tifffile.TiffFile(path) as file:
            values = _stack(path, file, hints)
    except CamkitError:
        raise
    except BROKEN as error:
        raise DecodeError(f"{path.name} is damaged, or no TIFF of counts: {error}") from error
    return ArrayFile(path, values, hints)


def _stack(path: Path, file: tifffile.TiffFile, hints: Hints) -> NDArray[Any]:
    """Give all pages, mapped or unpacked to a file where they are large."""
    pages = file.pages
    first = pages[0]
    shape, dtype = first.shape, first.dtype
    if len(shape) != 2:
        raise DecodeError(
            f"{path.name} holds pages of {shape}; expected rows and columns of counts"
        )
    series = file.series[0]
    whole = series.shape if len(file.series) == 1 else (len(pages), *shape)
    size = int(np.prod(whole, dtype=np.float64)) * np.dtype(dtype).itemsize
    if size > MOST_UNPACKED:
        raise DecodeError(f"{path.name} unpacks to {size / 1e9:.1f} GB; store it as HDF5")
    if len(file.series) > 1 and any(page.shape != shape for page in pages):
        raise DecodeError(f"{path.name} holds pages of several sizes; expected one")
    is_mapped = len(file.series) == 1 and series.dataoffset is not None
    if is_mapped and series.dataoffset + size > path.stat().st_size:
        raise DecodeError(f"{path.name} is cut off")
    out = "memmap" if size > hints.max_bytes else None
    values = (
        tifffile.memmap(path, mode="r") if is_mapped else file.asarray(key=slice(None), out=out)
    )
    return np.asarray(values).reshape(-1, *shape) if values.ndim != 2 else np.asarray(values)
