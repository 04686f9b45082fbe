"""HDF5, and MATLAB 7.3, which is HDF5 with its axes the other way round; read by h5py."""

from pathlib import Path
from typing import Any

from camkit.errors import CamkitError, DecodeError, UnsupportedError
from camkit.runtime.kinds.spad.containers.broken import BROKEN
from camkit.runtime.kinds.spad.files.counts_file import EXTRA, CountsFile, Hints


def open_hdf5(path: Path, hints: Hints, *, is_matlab: bool = False) -> CountsFile:
    """Open an HDF5 file; see `open_counts`."""
    try:
        import h5py

        from camkit.runtime.kinds.spad.files.hdf5_counts import counts_of
    except ImportError as error:
        raise UnsupportedError(f"reading {path.name} needs h5py: {EXTRA}") from error
    try:
        file = h5py.File(path, "r")
    except BROKEN as error:
        raise DecodeError(f"{path.name} is damaged, or no HDF5: {error}") from error
    try:
        return counts_of(path, file, hints, is_matlab=is_matlab)
    except CamkitError:
        file.close()
        raise
    except BROKEN as error:
        file.close()
        raise DecodeError(f"{path.name} is damaged: {error}") from error


def attribute_of(path: Path, name: str) -> Any:
    """Return the first small attribute of a name in an HDF5 file; None without one."""
    import h5py

    from camkit.runtime.kinds.spad.containers.hdf5_tree import small_attributes, tree_of

    with h5py.File(path, "r") as file:
        tree = tree_of(path, file)
        return next(
            (v for item in tree.items for v in small_attributes(tree, item, {name}).values()), None
        )
