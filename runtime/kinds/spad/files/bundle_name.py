"""The bundle that a capture itself names, as simulated ones do."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.errors import CamkitError
from camkit.runtime.kinds.spad.containers.broken import BROKEN
from camkit.runtime.kinds.spad.files.hdf5 import attribute_of
from camkit.runtime.kinds.spad.files.npz import read_npz
from camkit.runtime.kinds.spad.timing import read_timing, timing_beside

NAME: Final = "bundle"
"""Key of an NPZ, attribute of the data set of an HDF5, name in a timing file beside the capture."""
LONGEST: Final = 64


def named_bundle(path: Path) -> str | None:
    """Return the name; None for files that name none, or cannot be read.

    NPZ and HDF5 name it themselves, others in the timing file beside them.

    Reading the capture tells what is wrong with a file.
    """
    read = _READERS.get(path.suffix.lower(), _of_timing_file)
    try:
        value = np.asarray(read(path))
    except (CamkitError, ImportError, MemoryError, *BROKEN):
        return None
    if value.dtype.kind not in "US" or value.size != 1:
        return None
    name = value.item()
    if isinstance(name, bytes):
        name = name.decode("utf-8", "replace")
    return name if 0 < len(name) <= LONGEST else None


def _of_timing_file(path: Path) -> str:
    timing_path = timing_beside(path)
    return (read_timing(timing_path).array.bundle or "") if timing_path.is_file() else ""


def _of_npz(path: Path) -> Any:
    return read_npz(path, names=(NAME,)).get(NAME, "")


def _of_hdf5(path: Path) -> Any:
    name = attribute_of(path, NAME)
    return "" if name is None else name


_READERS: Final[Mapping[str, Callable[[Path], Any]]] = {
    ".npz": _of_npz,
    ".h5": _of_hdf5,
    ".hdf5": _of_hdf5,
}
