"""Small arrays that a timing file names: a measured pulse, maps of dark counts and hot pixels."""

import io
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from camkit.errors import ContractError

MOST_BYTES: Final = 64_000_000


def read_columns(path: Path, what: str) -> NDArray[np.float64]:
    """Read a text file of two columns, times and values.

    Args:
        path: Text; columns parted by commas or spaces; lines that begin with # are remarks.
        what: What it is, for errors.

    Returns:
        (2, n).

    Raises:
        ContractError: If it cannot be read so.
    """
    data = _bytes(path, what)
    try:
        text = data.decode("utf-8").replace(",", " ")
        rows = [line.split() for line in text.splitlines() if line.strip() and line[0] != "#"]
        found = np.array(rows, dtype=np.float64)
    except (UnicodeDecodeError, ValueError) as error:
        raise ContractError(f"{what} {path} must be lines of two numbers: {error}") from error
    if found.ndim != 2 or found.shape[1] != 2:
        raise ContractError(f"{what} {path} must be lines of two numbers")
    return np.ascontiguousarray(found.T)


def read_map(path: Path, what: str) -> NDArray[Any]:
    """Read an .npy file of one array (h, w).

    Raises:
        ContractError: If it is missing, no such file, larger than a map is, or not (h, w).
    """
    data = io.BytesIO(_bytes(path, what))
    try:
        found = npy.read_array(data, allow_pickle=False)
    except (ValueError, EOFError, TypeError, SyntaxError) as error:
        raise ContractError(f"{what} {path} must be an .npy file of numbers: {error}") from error
    if found.ndim != 2 or found.dtype.kind not in "biuf" or not np.isfinite(found).all():
        raise ContractError(
            f"{what} {path} must hold finite numbers (h, w); it holds {found.dtype} {found.shape}"
        )
    return np.asarray(found)


def _bytes(path: Path, what: str) -> bytes:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ContractError(f"{what} {path} has more than {MOST_BYTES // 10**6} MB")
        return path.read_bytes()
    except OSError as error:
        raise ContractError(f"cannot read {what} {path}: {error.strerror or error}") from error
