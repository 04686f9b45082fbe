"""NPZ: arrays by name, the cube among them; nothing in it is ever executed."""

import io
import math
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import DecodeError
from camkit.runtime.kinds.spad.containers.npy_header import Header, read_header
from camkit.runtime.kinds.spad.containers.packed import member_bytes, opened_zip
from camkit.runtime.kinds.spad.files.array_file import ArrayFile
from camkit.runtime.kinds.spad.files.counts_file import KEYS, CountsFile, Hints
from camkit.runtime.kinds.spad.files.variable import chosen_name, stated_values
from camkit.runtime.kinds.spad.timing import TABLE_OF

HEADER_BYTES: Final = 20_000
SMALL_BYTES: Final = 1_000_000
SUFFIX: Final = ".npy"


def open_npz(path: Path, hints: Hints) -> CountsFile:
    """Open an NPZ; see `open_counts`."""
    with opened_zip(path) as archive:
        members = {i.filename.removesuffix(SUFFIX): i for i in archive.infolist()}
        if not members:
            raise DecodeError(f"{path.name} holds 0 arrays; expected one of counts at least")
        headers = {name: _header(archive, info) for name, info in members.items()}
        shapes = {name: shape for name, (shape, _, _) in headers.items()}
        large = {name: shape for name, shape in shapes.items() if len(shape) > 1}
        name = chosen_name(path, large, hints, others=shapes)
        small = {
            other: _array(archive, members[other], headers[other], SMALL_BYTES)
            for other, (shape, _, _) in headers.items()
            if other in TABLE_OF and len(shape) <= 1 and members[other].file_size < SMALL_BYTES
        }
        values = _array(archive, members[name], headers[name], hints.max_bytes)
    return ArrayFile(path, values, hints, kind=KEYS.get(name), stated_times=stated_values(small))


def read_npz(
    path: Path, *, names: Collection[str] | None = None, max_bytes: int = SMALL_BYTES
) -> dict[str, NDArray[Any]]:
    """Read whole arrays by name, as large as the file says before anything is unpacked.

    Args:
        path: The file.
        names: Those to read, where they are there; None for all.
        max_bytes: Of all that are read.

    Raises:
        DecodeError: If the file is damaged, holds no arrays, or larger ones.
    """
    with opened_zip(path) as archive:
        members = {i.filename.removesuffix(SUFFIX): i for i in archive.infolist()}
        selected = {n: i for n, i in members.items() if names is None or n in names}
        size = sum(info.file_size for info in selected.values())
        if size > max_bytes:
            raise DecodeError(
                f"{path.name} unpacks to {size / 1e9:.1f} GB; expected at most "
                f"{max_bytes / 1e9:g} GB"
            )
        return {
            name: _array(archive, info, _header(archive, info), max_bytes)
            for name, info in selected.items()
        }


def _header(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Header:
    """Return shape, order and type of an array.

    Raises:
        DecodeError: If the member is no array, or a pickled one.
    """
    with archive.open(member) as file:
        start = io.BytesIO(file.read(HEADER_BYTES))
    shape, is_fortran, dtype = read_header(start, member.filename)
    if dtype.hasobject:
        raise DecodeError(
            f"{member.filename} holds pickled objects, which are never read; store numbers"
        )
    return shape, is_fortran, dtype


def _array(
    archive: zipfile.ZipFile, member: zipfile.ZipInfo, header: Header, max_bytes: int
) -> NDArray[Any]:
    """Return an array, mapped where it is stored as it is.

    Raises:
        DecodeError: If the member has fewer bytes than its header says.
    """
    shape, is_fortran, dtype = header
    data = member_bytes(archive, member, max_bytes)
    count = math.prod(shape) if min(shape, default=1) >= 0 else -1
    start = io.BytesIO(bytes(data[:HEADER_BYTES]))
    read_header(start, member.filename)
    if count < 0 or start.tell() + count * dtype.itemsize > member.file_size:
        raise DecodeError(
            f"{member.filename} says it is an array of {shape}, {dtype}, and has only "
            f"{member.file_size} bytes"
        )
    flat: NDArray[Any] = np.frombuffer(data, dtype=dtype, count=count, offset=start.tell())
    return flat.reshape(shape, order="F" if is_fortran else "C")
