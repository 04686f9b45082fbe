"""The PSF that a plate is to have: from an NPZ, or from a frozen PSF."""

import io
import zipfile
import zlib
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from camkit.errors import ContractError

KEY: Final = "psf"
MOST_BYTES: Final = 100_000
"""Of the array: 11x11 numbers need less than a hundredth of it."""
FROZEN: Final = ".safetensors"
_BROKEN: Final = (
    *(zipfile.BadZipFile, zlib.error, EOFError, ValueError, TypeError, SyntaxError),
    *(NotImplementedError, RuntimeError),
)


def read_target(path: Path) -> NDArray[Any]:
    """Read the PSF of a plate.

    Args:
        path: NPZ with the key `psf`, or a frozen PSF of single-photon cameras (.safetensors).

    Returns:
        What the file holds, of any shape.

    Raises:
        ContractError: If the file is missing, damaged, of another type, or has no such key.
        BundleError: If a frozen PSF is damaged.
    """
    if path.suffix.lower() == FROZEN:
        from camkit.models_def.kinds.spad.plate_psf import read_plate_psf

        return read_plate_psf(path)
    if path.suffix.lower() != ".npz":
        raise ContractError(
            f"a PSF is an .npz with the key {KEY}, or a frozen one ({FROZEN}); got {path}"
        )
    try:
        with zipfile.ZipFile(path) as archive:
            return _member(archive, path)
    except OSError as error:
        raise ContractError(f"cannot read {path}: {error.strerror or error}") from error
    except ContractError:
        raise
    except _BROKEN as error:
        raise ContractError(f"{path} is damaged, or no NPZ: {error}") from error


def _member(archive: zipfile.ZipFile, path: Path) -> NDArray[Any]:
    names = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
    if KEY not in names:
        keys = ", ".join(sorted(names)) or "nothing"
        raise ContractError(f"{path} must have the key {KEY}, the 11x11 PSF; it holds {keys}")
    if names[KEY].file_size > MOST_BYTES:
        raise ContractError(
            f"{KEY} of {path} unpacks to {names[KEY].file_size} bytes; an 11x11 PSF has less than "
            f"{MOST_BYTES}"
        )
    with archive.open(names[KEY]) as member:
        data = io.BytesIO(member.read(MOST_BYTES))
    version = npy.read_magic(data)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(data)
    if dtype.hasobject:
        raise ContractError(
            f"{KEY} of {path} holds pickled objects, which are never read; store numbers"
        )
    # a header may speak of more than there is, and numpy would make room for it
    if np.prod(shape, dtype=float) * dtype.itemsize > MOST_BYTES:
        raise ContractError(f"{KEY} of {path} must be 11x11; it states {shape}")
    data.seek(0)
    return np.asarray(npy.read_array(data, allow_pickle=False))
