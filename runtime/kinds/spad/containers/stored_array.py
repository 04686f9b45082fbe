"""Small arrays that a timing file names: a measured pulse, maps of dark counts and hot pixels."""

import io
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from camkit.errors import ContractError, DecodeError
from camkit.runtime.kinds.spad.containers.npy_header import BROKEN_HEADER, read_header
from camkit.side_file import read_side_bytes

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
    data = read_side_bytes(path, what, most_bytes=MOST_BYTES)
    try:
        text = data.decode("utf-8").replace(",", " ")
        rows = [line.split() for line in text.splitlines() if line.strip() and line[0] != "#"]
        odd = next((row for row in rows if len(row) != 2), None)
        columns = np.array(rows if odd is None else [], dtype=np.float64)
    except ValueError as error:
        raise ContractError(f"{what} {path} must be lines of two numbers: {error}") from error
    if columns.ndim != 2:
        came = "none" if odd is None else f"{len(odd)} in {' '.join(odd)[:60]!r}"
        raise ContractError(f"{what} {path} must be lines of two numbers; got {came}")
    return np.ascontiguousarray(columns.T)


def read_map(path: Path, what: str) -> NDArray[Any]:
    """Read an .npy file of one array (h, w).

    Raises:
        ContractError: If it is missing, no such file, larger than a map is, or not (h, w).
    """
    data = read_side_bytes(path, what, most_bytes=MOST_BYTES)
    try:
        _check_announced(data, path.name)
        values = npy.read_array(io.BytesIO(data), allow_pickle=False)
    except (*BROKEN_HEADER, DecodeError) as error:
        raise ContractError(f"{what} {path} must be an .npy file of numbers: {error}") from error
    if values.ndim != 2 or values.dtype.kind not in "biuf" or not np.isfinite(values).all():
        raise ContractError(
            f"{what} {path} must hold finite numbers (h, w); it holds {values.dtype} {values.shape}"
        )
    return np.asarray(values)


def _check_announced(data: bytes, name: str) -> None:
    """Refuse an array that announces more than there is, before numpy makes room for it.

    Raises:
        DecodeError: Says what came.
    """
    shape, _, dtype = read_header(io.BytesIO(data), name)
    if math.prod(shape) * dtype.itemsize > len(data):
        raise DecodeError(
            f"an array {shape} of {dtype} is announced, and there are {len(data)} bytes"
        )
