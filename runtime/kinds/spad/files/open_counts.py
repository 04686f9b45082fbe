"""The reader of a file, by its type."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from camkit.errors import DecodeError, UnsupportedError
from camkit.regular_file import check_regular
from camkit.runtime.kinds.spad.files.counts_file import CountsFile, Hints
from camkit.runtime.kinds.spad.files.hdf5 import open_hdf5
from camkit.runtime.kinds.spad.files.mat import open_mat
from camkit.runtime.kinds.spad.files.npz import open_npz
from camkit.runtime.kinds.spad.files.ptu import open_ptu
from camkit.runtime.kinds.spad.files.sdt import open_sdt, open_sdt_zip
from camkit.runtime.kinds.spad.files.spc import open_spc
from camkit.runtime.kinds.spad.files.tiff import open_tiff

READERS: Final[Mapping[str, Callable[[Path, Hints], CountsFile]]] = {
    ".npz": open_npz,
    ".h5": open_hdf5,
    ".hdf5": open_hdf5,
    ".mat": open_mat,
    ".tif": open_tiff,
    ".tiff": open_tiff,
    ".ptu": open_ptu,
    ".sdt": open_sdt,
    ".zip": open_sdt_zip,
    ".spc": open_spc,
}


def open_counts(path: Path, hints: Hints) -> CountsFile:
    """Open a capture of single photons.

    Args:
        path: The file; its type is that of its name.
        hints: What the caller knows of it.

    Raises:
        DecodeError: If it is damaged, empty, or holds no counts.
        ContractError: If it holds several variables, or an array whose axes nobody states.
        UnsupportedError: If such files are not read, or the library for them is not installed.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise UnsupportedError(
            f"captures of single photons in files of type {path.suffix or 'none'} are not read; "
            f"read are {', '.join(READERS)}"
        )
    try:
        check_regular(path)
        if path.stat().st_size == 0:
            raise DecodeError(f"{path.name} is empty")
        return reader(path, hints)
    except OSError as error:
        raise DecodeError(f"cannot read {path.name}: {error.strerror or error}") from error
    except MemoryError as error:
        raise DecodeError(f"{path.name} takes more memory than there is") from error
