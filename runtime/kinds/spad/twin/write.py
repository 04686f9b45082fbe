"""Simulated captures as files: NPZ, HDF5, TIFF, MAT, PTU.

What a type of file cannot say of itself stands in a timing file beside it, NAME.TYPE.toml.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import scipy.io
import tifffile
from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.kinds.spad.files.bundle_name import NAME
from camkit.runtime.kinds.spad.files.counts_file import EXTRA
from camkit.runtime.kinds.spad.timing import TABLE_OF, timing_beside
from camkit.runtime.kinds.spad.twin.recording import Recorded
from camkit.runtime.output.part_file import atomic_output

CYCLE: Final = 2
"""Of a PTU: the laser's period over the time that all bins take."""
MOST_STAMPS: Final = 50_000_000
"""Photons of a PTU, 200 MB."""


def write_recorded(path: Path, recorded: Recorded, _bundle: Bundle | None = None) -> None:
    """Write a capture; the suffix says as what, and the capture which bundle it is of.

    Raises:
        UnsupportedError: If a package is missing that writes such files.
        ContractError: If such files cannot hold it.
        OSError: If it cannot be written.
    """
    suffix = path.suffix.lower()
    with atomic_output(path) as part:
        _WRITERS[suffix](part, recorded)
    *_, timing_path = files_of(path)
    if timing_path == path:
        return
    axes = {".mat": "yxt"}.get(suffix) if recorded.values.ndim == 3 else None
    with atomic_output(timing_path) as part:
        text = timing_text(recorded.attributes, axes=axes, bundle=recorded.attributes.get(NAME))
        part.write_text(text, encoding="utf-8")


def files_of(path: Path) -> tuple[Path, ...]:
    """Return the files of a capture: itself, and its timing file where it needs one."""
    if path.suffix.lower() in _SAY_ALL:
        return (path,)
    return path, timing_beside(path)


def timing_text(
    values: Mapping[str, Any], *, axes: str | None = None, bundle: str | None = None
) -> str:
    """Return a timing file of what is stated."""
    tables: dict[str, list[str]] = {}
    for name, value in (("axes", axes), ("bundle", bundle)):
        if value is not None:
            tables.setdefault("array", []).append(f'{name} = "{value}"')
    for name, value in values.items():
        if name in TABLE_OF:
            literal = f'"{value}"' if isinstance(value, str) else repr(value)
            tables.setdefault(TABLE_OF[name], []).append(f"{name} = {literal}")
    return "\n\n".join("\n".join([f"[{n}]", *lines]) for n, lines in tables.items()) + "\n"


def _write_npz(path: Path, recorded: Recorded) -> None:
    arrays: dict[str, Any] = {recorded.name: _small(recorded.values), **recorded.attributes}
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _write_hdf5(path: Path, recorded: Recorded) -> None:
    try:
        import h5py
    except ImportError as error:
        raise UnsupportedError(f"writing HDF5 needs h5py: {EXTRA}") from error
    with h5py.File(path, "w") as file:
        values = _small(recorded.values)
        data_set = file.create_dataset(recorded.name, data=values, compression="gzip")
        data_set.attrs.update(dict(recorded.attributes))


def _write_tiff(path: Path, recorded: Recorded) -> None:
    tifffile.imwrite(path, _small(recorded.values), photometric="minisblack")


def _write_mat(path: Path, recorded: Recorded) -> None:
    values = _small(recorded.values)
    array = values.transpose(1, 2, 0) if values.ndim == 3 else values
    scipy.io.savemat(path, {recorded.name: array}, do_compression=True, appendmat=False)


def _write_ptu(path: Path, recorded: Recorded) -> None:
    try:
        import ptufile
    except ImportError as error:
        raise UnsupportedError(f"writing PTU needs ptufile: {EXTRA}") from error
    bin_ps = recorded.attributes.get("time_bin_ps")
    if recorded.values.ndim != 3 or bin_ps is None:
        raise ContractError("a PTU holds times of photons; write counts as NPZ, HDF5, TIFF or MAT")
    stamps = int(recorded.values.sum(dtype=np.int64))
    if stamps > MOST_STAMPS:
        raise ContractError(
            f"a PTU holds every photon by itself: {stamps} of them, more than {MOST_STAMPS}; write "
            "the histogram as .npz or .h5, or take fewer photons"
        )
    cube = np.ascontiguousarray(recorded.values.transpose(1, 2, 0))
    period_s = CYCLE * cube.shape[2] * bin_ps * 1e-12
    ptufile.imwrite(path, _small(cube), period_s, bin_ps * 1e-12)


def _small(values: NDArray[Any]) -> NDArray[Any]:
    """Return counts in 16 bits where they fit."""
    return values.astype(np.uint16) if values.max(initial=0) < 2**16 else values


_WRITERS: Final[Mapping[str, Callable[[Path, Recorded], None]]] = {
    ".npz": _write_npz,
    ".h5": _write_hdf5,
    ".tif": _write_tiff,
    ".mat": _write_mat,
    ".ptu": _write_ptu,
}
_SAY_ALL: Final = (".npz", ".h5")
SUFFIXES: Final = tuple(_WRITERS)
