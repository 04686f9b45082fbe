"""Counts in an open HDF5 file: the data set that is meant, measured in bytes before it is read."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from camkit.caller import option_text
from camkit.errors import CamkitError, ContractError, DecodeError
from camkit.runtime.kinds.spad.containers.broken import BROKEN
from camkit.runtime.kinds.spad.containers.hdf5_tree import (
    Tree,
    check_readable,
    is_small,
    links_told,
    piece_bytes,
    small_attributes,
    tree_of,
    type_of,
)
from camkit.runtime.kinds.spad.files.array_file import ArrayFile
from camkit.runtime.kinds.spad.files.axes import backwards
from camkit.runtime.kinds.spad.files.counts_file import KEYS, CountsFile, Hints
from camkit.runtime.kinds.spad.files.stamps import StampsFile
from camkit.runtime.kinds.spad.files.variable import chosen_name, stated_values
from camkit.runtime.kinds.spad.timing import TABLE_OF

MATLAB_EMPTY: Final = "MATLAB_empty"


def counts_of(path: Path, file: Any, hints: Hints, *, is_matlab: bool) -> CountsFile:
    """Return the counts of an open file; arguments and errors as of `open_hdf5`."""
    tree = tree_of(path, file)
    large = {n: d for n, d in tree.sets.items() if d.ndim > 1 and min(d.shape) > 0 and _is_cube(d)}
    _check_links(path, tree, large, hints)
    name = chosen_name(
        path,
        {n: d.shape for n, d in large.items()},
        hints,
        "data sets",
        {n: d.shape or () for n, d in tree.sets.items()},
    )
    data_set = large[name]
    check_readable(path, name, data_set)
    stated_times = _stated_times(tree, file, data_set)
    if h5py.check_ref_dtype(data_set.dtype) is not None:
        return _cells(path, file, data_set, stated_times, hints)
    _check_pieces(path, name, data_set, hints)
    kind = KEYS.get(name.rsplit("/", 1)[-1])
    usual = "tyx" if kind is not None else None
    if is_matlab:  # MATLAB counts its axes from the other end
        hints = replace(hints, axes=None if hints.axes is None else backwards(hints.axes))
        usual = None if usual is None else usual[::-1]
    counts = ArrayFile(
        path, data_set, hints, kind=kind, usual=usual, stated_times=stated_times, close=file.close
    )
    counts.axes = backwards(counts.axes) if is_matlab else counts.axes
    return counts


def _check_links(path: Path, tree: Tree, large: Mapping[str, Any], hints: Hints) -> None:
    """Refuse to look past a link that is meant, or that might be where nothing else is there.

    Raises:
        DecodeError: Says where it leads.
    """
    if hints.key is not None:
        links = [] if hints.key in large else links_told(tree, {hints.key})
    elif any(name.rsplit("/", 1)[-1] in KEYS for name in large):
        links = []
    else:
        links = links_told(tree, KEYS if large else None)
    if links:
        raise DecodeError(
            f"{path.name} holds no data sets of counts, histograms or time stamps itself: "
            f"{links[0]}; name the place itself by [array] key, or store it in this file"
        )


def _stated_times(tree: Tree, file: Any, data_set: Any) -> dict[str, object]:
    """Return what small data sets and attributes say of times."""
    by_name = {n.rsplit("/", 1)[-1]: item for n, item in tree.sets.items()}
    values = {
        n: i[()] for n, i in by_name.items() if n in TABLE_OF and i.size and is_small(i, tree)
    }
    return stated_values(
        {
            **values,
            **small_attributes(tree, file, TABLE_OF),
            **small_attributes(tree, data_set, TABLE_OF),
        }
    )


def _check_pieces(path: Path, name: str, item: Any, hints: Hints) -> None:
    """Refuse an array that is packed in pieces larger than the memory.

    Raises:
        ContractError: Says how large they are.
    """
    size = piece_bytes(item)
    if size > hints.max_bytes:
        raise ContractError(
            f"{path.name}: {name} is packed in pieces of {size / 1e9:.3g} GB, more than fits the "
            f"memory; raise {option_text('max_mem_bytes')}, or pack it anew in smaller chunks "
            "(h5repack)"
        )


def _is_cube(item: Any) -> bool:
    """Return whether a data set may hold counts, or the cells that hold stamps; no vectors."""
    is_cells = h5py.check_ref_dtype(item.dtype) is not None
    is_vector = sum(side > 1 for side in item.shape) < 2
    return is_cells or (item.dtype.kind in "biuf" and not is_vector)


def _cells(
    path: Path, file: Any, cells: Any, stated_times: dict[str, object], hints: Hints
) -> CountsFile:
    if cells.ndim != 2:
        raise DecodeError(
            f"{path.name}: cells of time stamps must be (rows, columns); got {cells.shape}"
        )
    _check_pieces(path, cells.name, cells, hints)
    width, height = cells.shape

    def row(y: int) -> Sequence[NDArray[Any]]:
        try:
            items = [file[ref] for ref in cells[:, y]]
            _check_cells(path, items, hints)
            return [_cell(item) for item in items]
        except CamkitError:
            raise
        except BROKEN as error:
            raise DecodeError(f"{path.name} is damaged: {error}") from error

    return StampsFile(
        path, (height, width), row, stated_times=stated_times, close=partial(file.close)
    )


def _check_cells(path: Path, items: Sequence[Any], hints: Hints) -> None:
    """Refuse cells that hold anything but arrays, or together more than fits the memory.

    Raises:
        DecodeError: If one holds something else.
        ContractError: If a row takes too much.
    """
    size = 0
    for item in items:
        if not isinstance(item, h5py.Dataset) or type_of(item) is None or item.shape is None:
            raise DecodeError(f"{path.name}: a cell holds no array; expected time stamps")
        size += max(math.prod(item.shape) * item.dtype.itemsize, piece_bytes(item))
    if size > hints.max_bytes:
        raise ContractError(
            f"{path.name}: the time stamps of one row of pixels take {size / 1e9:.3g} GB, more "
            f"than fits the memory; raise {option_text('max_mem_bytes')}, or cut the capture into "
            "several files"
        )


def _cell(item: Any) -> NDArray[Any]:
    """Return the stamps of a cell; MATLAB stores the size of an empty one in its place."""
    if not item.size or item.attrs.get(MATLAB_EMPTY, 0):
        return np.empty(0)
    return np.asarray(item[()])
