"""MATLAB files: version 5 by scipy, version 7.3 as HDF5."""

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
import scipy.io

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.runtime.kinds.spad.containers.broken import BROKEN
from camkit.runtime.kinds.spad.containers.mat_sizes import (
    Listed,
    bytes_of,
    is_version_5,
    listed_variables,
)
from camkit.runtime.kinds.spad.files.array_file import ArrayFile
from camkit.runtime.kinds.spad.files.counts_file import KEYS, CountsFile, Hints
from camkit.runtime.kinds.spad.files.hdf5 import open_hdf5
from camkit.runtime.kinds.spad.files.stamps import StampsFile
from camkit.runtime.kinds.spad.files.variable import chosen_name, stated_values
from camkit.runtime.kinds.spad.timing import TABLE_OF

HDF5_MAGIC: Final = b"\x89HDF\r\n\x1a\n"
USER_BLOCK: Final = 512
"""Bytes before the HDF5 of version 7.3."""
DAMAGED: Final = (*BROKEN, scipy.io.matlab.MatReadError, UserWarning)
"""What scipy raises of files that are damaged."""
BYTES_OF: Final = {
    "single": 4,
    "logical": 1,
    "int8": 1,
    "uint8": 1,
    "int16": 2,
    "uint16": 2,
    "int32": 4,
    "uint32": 4,
}
PLAIN: Final = frozenset({*BYTES_OF, "double", "int64", "uint64", "char"})
"""Classes of values that may state something of times."""
SMALL_BYTES: Final = 1_000_000
TIMES: Final = 3
"""Of max_bytes: version 5 is read whole."""


def open_mat(path: Path, hints: Hints) -> CountsFile:
    """Open a MATLAB file; see `open_counts`."""
    with path.open("rb") as file:
        head = file.read(USER_BLOCK + len(HDF5_MAGIC))
    if HDF5_MAGIC in (head[: len(HDF5_MAGIC)], head[USER_BLOCK:]):
        return open_hdf5(path, hints, is_matlab=True)
    is_walked = is_version_5(path)
    listed = listed_variables(path) if is_walked else _listed_by_scipy(path)
    kinds = {name: (shape, kind) for name, shape, kind in listed if min(shape, default=0) > 0}
    large = [name for name, (shape, kind) in kinds.items() if _may_be(name, shape, kind)]
    matches = [name for name in kinds if name == hints.key]
    shapes = {name: shape for name, (shape, _) in kinds.items()}
    candidates = {name: shapes[name] for name in matches or large}
    name = chosen_name(path, candidates, hints, "variables", {n: s for n, s, _ in listed})
    most = TIMES * hints.max_bytes
    size = 0 if kinds[name][1] == "cell" else _listed_bytes(*kinds[name])
    if is_walked and size <= most:
        size = bytes_of(path, {name}, most)
    if size > most:
        raise ContractError(
            f"{path.name}: {name} takes {size / 1e9:.3g} GB or more, and this version of MATLAB "
            "file can only be read whole; save it with -v7.3, or raise "
            f"{option_text('max_mem_bytes')}"
        )
    small = [
        n
        for n, (_, matlab_class) in kinds.items()
        if n in TABLE_OF and matlab_class in PLAIN and _listed_bytes(*kinds[n]) <= SMALL_BYTES
    ]
    try:
        with _doubts_raised():
            variables = scipy.io.loadmat(str(path), appendmat=False, variable_names=[name, *small])
        values, stated_times = variables[name], stated_values({n: variables[n] for n in small})
    except DAMAGED as error:
        raise DecodeError(f"{path.name} is damaged: {error}") from error
    if values.dtype == object:
        if values.ndim != 2:
            raise DecodeError(
                f"{path.name}: cells of time stamps must be (rows, columns); got {values.shape}"
            )
        return StampsFile(
            path,
            values.shape,
            lambda y: [_cell(path, c) for c in values[y]],
            stated_times=stated_times,
        )
    usual = "tyx" if name in KEYS else None
    return ArrayFile(
        path, values, hints, kind=KEYS.get(name), usual=usual, stated_times=stated_times
    )


def _listed_by_scipy(path: Path) -> list[Listed]:
    """Return the variables of a file that is not packed."""
    try:
        with _doubts_raised():
            return list(scipy.io.whosmat(str(path), appendmat=False))
    except DAMAGED as error:
        raise DecodeError(f"{path.name} is damaged, or no MATLAB file: {error}") from error


@contextmanager
def _doubts_raised() -> Iterator[None]:
    """Raise what scipy doubts of a file, but for a name that occurs twice."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        warnings.simplefilter("ignore", scipy.io.matlab.MatReadWarning)
        yield


def _listed_bytes(shape: tuple[int, ...], kind: str) -> int:
    """Return what an array of numbers takes."""
    return math.prod(shape) * BYTES_OF.get(kind, 8)


def _may_be(name: str, shape: tuple[int, ...], kind: str) -> bool:
    """Return whether a variable may hold counts or cells of stamps."""
    if name in TABLE_OF or kind in {"char", "struct", "object", "opaque", "function", "sparse"}:
        return False
    return kind == "cell" or sum(side > 1 for side in shape) > 1


def _cell(path: Path, cell: Any) -> np.ndarray[Any, Any]:
    if not isinstance(cell, np.ndarray):
        raise DecodeError(f"{path.name}: a cell holds {type(cell).__name__}, not time stamps")
    return cell
