"""HDF5, and MATLAB 7.3, which is HDF5 with its axes the other way round; read by h5py."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import CamkitError, DecodeError, UnsupportedError
from camkit.runtime.kinds.spad.files.array_file import ArrayFile
from camkit.runtime.kinds.spad.files.chosen import chosen_name, stated_values
from camkit.runtime.kinds.spad.files.counts_file import EXTRA, KEYS, CountsFile, Hints
from camkit.runtime.kinds.spad.files.stamps import StampsFile

BROKEN: Final = (OSError, RuntimeError, ValueError, KeyError, TypeError)
"""What h5py raises of files that are damaged."""
REFERENCES: Final = "#refs#"
SMALL: Final = 100_001
MATLAB_CLASS: Final = "MATLAB_class"
MATLAB_EMPTY: Final = "MATLAB_empty"


def open_hdf5(path: Path, hints: Hints, *, is_matlab: bool = False) -> CountsFile:
    """Open an HDF5 file; see `open_counts`."""
    try:
        import h5py
    except ImportError as error:
        raise UnsupportedError(f"reading {path.name} needs h5py: {EXTRA}") from error
    try:
        file = h5py.File(path, "r")
    except BROKEN as error:
        raise DecodeError(f"{path.name} is damaged, or no HDF5: {error}") from error
    try:
        return _opened(path, file, hints, is_matlab=is_matlab)
    except CamkitError:
        file.close()
        raise
    except BROKEN as error:
        file.close()
        raise DecodeError(f"{path.name} is damaged: {error}") from error


def _opened(path: Path, file: Any, hints: Hints, *, is_matlab: bool) -> CountsFile:
    import h5py

    sets: dict[str, Any] = {}
    file.visititems(
        lambda name, item: (
            sets.update({name: item})
            if isinstance(item, h5py.Dataset) and not name.startswith(REFERENCES)
            else None
        )
    )
    large = {n: d for n, d in sets.items() if d.ndim > 1 and min(d.shape) > 0 and _is_cube(d)}
    name = chosen_name(path, large, hints, "data sets")
    chosen = large[name]
    if chosen.is_virtual or chosen.external:
        raise DecodeError(f"{path.name}: {name} lies in other files; store it in one")
    # a null data set has no size at all
    small = {n.rsplit("/", 1)[-1]: d[()] for n, d in sets.items() if 0 < (d.size or 0) < SMALL}
    stated = stated_values({**small, **dict(file.attrs), **dict(chosen.attrs)})
    if h5py.check_ref_dtype(chosen.dtype) is not None:
        return _cells(path, file, chosen, stated)
    kind = KEYS.get(name.rsplit("/", 1)[-1])
    usual = "tyx" if kind is not None else None
    if is_matlab:  # MATLAB counts its axes from the other end
        axes = hints.axes
        hints = replace(hints, axes=None if axes is None else axes[::-1])
        usual = None if usual is None else usual[::-1]
    found = ArrayFile(path, chosen, hints, kind=kind, usual=usual, stated=stated, close=file.close)
    found.axes = found.axes[::-1] if is_matlab else found.axes
    return found


def _is_cube(item: Any) -> bool:
    """Tell whether a data set may hold counts, or the cells that hold stamps; vectors do not."""
    import h5py

    is_cells = h5py.check_ref_dtype(item.dtype) is not None
    is_vector = sum(side > 1 for side in item.shape) < 2
    return is_cells or (item.dtype.kind in "biuf" and not is_vector)


def _cells(path: Path, file: Any, cells: Any, stated: dict[str, object]) -> CountsFile:
    if cells.ndim != 2:
        raise DecodeError(f"{path.name}: cells of time stamps must be (rows, columns)")
    width, height = cells.shape

    def row(y: int) -> Sequence[NDArray[Any]]:
        try:
            return [_cell(file[ref]) for ref in cells[:, y]]
        except BROKEN as error:
            raise DecodeError(f"{path.name} is damaged: {error}") from error

    return StampsFile(path, (height, width), row, stated=stated, close=partial(file.close))


def _cell(item: Any) -> NDArray[Any]:
    """Give the stamps of a cell; MATLAB stores the size of an empty one in its place."""
    if item.attrs.get(MATLAB_EMPTY, 0) or not item.size:
        return np.empty(0)
    return np.asarray(item[()])
