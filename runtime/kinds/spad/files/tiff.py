"""TIFF: a page of counts, or a stack whose pages are time."""

import logging
import math
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from numpy.typing import NDArray

from camkit.errors import CamkitError, DecodeError
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.containers.broken import BROKEN
from camkit.runtime.kinds.spad.containers.packed import MOST_UNPACKED
from camkit.runtime.kinds.spad.files.array_file import ArrayFile
from camkit.runtime.kinds.spad.files.channels import chosen_places
from camkit.runtime.kinds.spad.files.counts_file import CountsFile, Hints
from camkit.runtime.kinds.spad.files.tiff_pages import check_pages, check_whole, stack_axes

logging.getLogger("tifffile").addHandler(logging.NullHandler())


def open_tiff(path: Path, hints: Hints) -> CountsFile:
    """Open a TIFF; see `open_counts`."""
    try:
        with tifffile.TiffFile(path) as file:
            axes, values = _stack(path, file, hints)
    except CamkitError:
        raise
    except (*BROKEN, tifffile.TiffFileError, ImportError) as error:
        # ImportError: a packing that needs a library of its own
        raise DecodeError(f"{path.name} is damaged, or no TIFF of counts: {error}") from error
    return ArrayFile(path, values, replace(hints, axes=axes))


def _stack(path: Path, file: tifffile.TiffFile, hints: Hints) -> tuple[str | None, NDArray[Any]]:
    """Return the axes and all pages, mapped or unpacked to a file where they are large."""
    first = file.pages[0]
    shape = first.shape
    if len(shape) != 2:
        raise DecodeError(
            f"{path.name} holds pages of {shape}; expected rows and columns of counts"
        )
    series, places = _series(path, file, hints)
    other = next((page.shape for page in file.pages if page.shape != shape), None)
    if series is None and other is not None:
        raise DecodeError(f"{path.name} holds pages of several sizes, {shape} and {other}")
    whole = (len(file.pages), *shape) if series is None else series.shape
    size = math.prod(whole) * np.dtype(first.dtype).itemsize
    if size > MOST_UNPACKED:
        raise DecodeError(
            f"{path.name} unpacks to {size / 1e9:.1f} GB; expected at most "
            f"{MOST_UNPACKED / 1e9:g} GB: store it as HDF5"
        )
    check_whole(path, file)
    axes = hints.axes
    if series is not None and axes is None:
        axes = stack_axes(path, series.axes, series.shape, places)
    if series is not None and series.dataoffset is not None:
        if series.dataoffset + size > (file_bytes := path.stat().st_size):
            raise DecodeError(
                f"{path.name} is cut off: {series.dataoffset + size} bytes are announced, "
                f"{file_bytes} are there"
            )
        return axes, np.memmap(path, series.dtype, "r", series.dataoffset, series.shape)
    pages = file.pages if series is None else series
    check_pages(path, pages, hints.max_bytes)
    if size > hints.max_bytes:
        return axes, _spilled(pages, first).reshape(whole)
    if series is None:
        values = file.asarray(key=slice(None), maxworkers=1)
    else:
        values = series.asarray(maxworkers=1)
    return axes, np.asarray(values).reshape(whole)


def _spilled(pages: Iterable[Any], first: Any) -> NDArray[Any]:
    """Return pages unpacked one by one to a file without a name, and mapped."""
    with tempfile.TemporaryFile() as file:
        for page in pages:
            check_wish()
            # tifffile has None for a page that its series lacks
            values = np.zeros(first.shape, first.dtype) if page is None else page.asarray()
            file.write(np.ascontiguousarray(values, first.dtype).data)
        file.flush()
        return np.memmap(file, first.dtype, "r")


def _series(
    path: Path, file: tifffile.TiffFile, hints: Hints
) -> tuple[tifffile.TiffPageSeries | None, str | None]:
    """Return the series that is meant, and what the key says of its places.

    None stands for single pages that make up a stack, each a series of its own to tifffile.
    """
    series = file.series
    if len(series) == 1:
        return series[0], hints.key
    if all(len(one) == 1 for one in series):
        return None, hints.key
    mine, *others = [part.strip() for part in (hints.key or "").split(",")]
    place = chosen_places(path, {"series": range(len(series))}, mine or None)["series"]
    return series[place], ", ".join(others) or None
