"""Arrays of kernels in files of numpy and MATLAB."""

import zipfile
import zlib
from collections.abc import Mapping
from importlib import util
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError, UnsupportedError

SUFFIXES: Final = (".npy", ".npz", ".mat")
HDF5: Final = b"\x89HDF\r\n\x1a\n"
_MATLAB_HEADER: Final = 512
"""A MATLAB file of version 7.3 is HDF5 behind a header of its own."""
_DAMAGED: Final = (
    *(OSError, ValueError, TypeError, KeyError, EOFError, NotImplementedError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, IndexError, OverflowError),
)


def read_array(path: Path, variable: str | None) -> NDArray[Any]:
    """Read the array of a file.

    Args:
        path: .npy, .npz or .mat.
        variable: Its name in a file of several; None for the only one of two axes or more.

    Raises:
        DecodeError: If the file is damaged, or holds objects.
        ContractError: If the array is not there, or there are several.
        UnsupportedError: If reading it needs a package that is not installed.
    """
    suffix = path.suffix.lower()
    if suffix == ".npy":
        array: NDArray[Any] = _loaded(path)
        return array
    return _selected_array(_matlab(path) if suffix == ".mat" else _zipped(path), variable, path)


def _loaded(path: Path) -> Any:
    try:
        return np.load(path, allow_pickle=False)
    except _DAMAGED as error:
        raise DecodeError(
            f"{path.name} is no plain array of numpy ({error}); save it by numpy.save"
        ) from error


def _zipped(path: Path) -> Mapping[str, NDArray[Any]]:
    archive = _loaded(path)
    try:
        return {name: archive[name] for name in archive.files}
    except (AttributeError, *_DAMAGED) as error:
        raise DecodeError(f"{path.name} is no archive of plain arrays: {error}") from error


def _matlab(path: Path) -> Mapping[str, NDArray[Any]]:
    with path.open("rb") as file:
        head = file.read(_MATLAB_HEADER + len(HDF5))
    if HDF5 in (head[: len(HDF5)], head[_MATLAB_HEADER:]):
        return _matlab_hdf5(path)
    from scipy.io import loadmat

    try:
        table = loadmat(path)
    except _DAMAGED as error:
        raise DecodeError(f"{path.name} is no sound MATLAB file: {error}") from error
    return {name: value for name, value in table.items() if not name.startswith("__")}


def _matlab_hdf5(path: Path) -> Mapping[str, NDArray[Any]]:
    """Read arrays of version 7.3, whose axes stand in reverse."""
    if util.find_spec("h5py") is None:
        raise UnsupportedError(
            f"{path.name} is a MATLAB file of version 7.3 (HDF5), which needs h5py: install it "
            "with: pip install 'camkit[spad]', or save with -v7"
        )
    import h5py

    try:
        with h5py.File(path, "r") as file:
            arrays = {name: value for name, value in file.items() if hasattr(value, "shape")}
            return {name: np.asarray(value).T for name, value in arrays.items()}
    except _DAMAGED as error:
        raise DecodeError(f"{path.name} is no sound MATLAB file: {error}") from error


def _selected_array(
    arrays: Mapping[str, NDArray[Any]], variable: str | None, path: Path
) -> NDArray[Any]:
    names = ", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "nothing"
    if variable is not None:
        if variable not in arrays:
            raise ContractError(f"{path.name} holds no {variable}; it holds {names}")
        return arrays[variable]
    large = [array for array in arrays.values() if array.ndim >= 2 and array.size > 1]
    if len(large) != 1:
        raise ContractError(
            f"{path.name} holds {names}; name the kernels by {option_text('variable')} NAME"
        )
    return large[0]
