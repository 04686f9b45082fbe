"""The bundle that a capture itself names, as simulated ones do."""

import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.runtime.kinds.spad.timing import read_timing, timing_beside

NAME: Final = "bundle"
"""Key of an NPZ, attribute of the data set of an HDF5, name in a timing file beside the capture."""
LONGEST: Final = 64


def named_bundle(path: Path) -> str | None:
    """Give the name; None for files that name none, or cannot be read.

    NPZ and HDF5 name it themselves, others in the timing file beside them.

    Reading the capture tells what is wrong with a file.
    """
    read = _READERS.get(path.suffix.lower())
    try:
        found = _beside(path) if read is None else str(np.asarray(read(path)).item())
    except (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, ImportError):
        return None
    return found if 0 < len(found) <= LONGEST else None


def _beside(path: Path) -> str:
    beside = timing_beside(path)
    return (read_timing(beside).array.bundle or "") if beside.is_file() else ""


def _of_npz(path: Path) -> Any:
    with np.load(path, allow_pickle=False) as file:
        return file[NAME]


def _of_hdf5(path: Path) -> Any:
    import h5py

    found: list[Any] = []
    with h5py.File(path, "r") as file:
        file.visititems(
            lambda _, item: found.append(item.attrs[NAME]) if NAME in item.attrs else None
        )
    return found[0] if found else ""


_READERS: Final[Mapping[str, Callable[[Path], Any]]] = {
    ".npz": _of_npz,
    ".h5": _of_hdf5,
    ".hdf5": _of_hdf5,
}
