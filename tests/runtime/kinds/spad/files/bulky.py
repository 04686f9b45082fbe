"""Small files of single photons that unpack to gigabytes, or nest without an end."""

import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import scipy.io

MB = 1_000_000


def wide_texts(path: Path) -> None:
    """Write a data set of texts of 26 kB each beside a small cube."""
    with h5py.File(path, "w") as file:
        file["histogram"] = np.ones((16, 2, 2), np.uint8)
        file.create_dataset("orientation", (100_000,), "S26000", chunks=(100,), compression=9)


def wide_attribute(path: Path) -> None:
    with h5py.File(path, "w", libver="latest") as file:
        made = file.create_dataset("histogram", data=np.ones((16, 2, 2), np.uint8))
        made.attrs.create("orientation", np.zeros(3, "S500000"))


def large_chunk(path: Path) -> None:
    """Write a cube of one packed piece of 1 GB of zeros, never stored."""
    with h5py.File(path, "w") as file:
        file.create_dataset(
            "histogram", (1000, 1000, 1000), "u1", chunks=(1000, 1000, 1000), compression=1
        )


def chunk_beyond_its_array(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["histogram"] = np.ones((16, 2, 2), np.uint8)
        file.create_dataset("cycles", (1,), "f8", maxshape=(None,), chunks=(2**27,), compression=1)


def large_cells_of_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        cells = file.create_dataset("photons", (2, 2), h5py.ref_dtype)
        zeros = file.create_dataset("#refs#/a", (1, 250 * MB), "f8", chunks=(1, MB), compression=1)
        cells[:] = np.full((2, 2), zeros.ref, dtype=h5py.ref_dtype)


def cells_of_groups(path: Path) -> None:
    with h5py.File(path, "w") as file:
        cells = file.create_dataset("photons", (2, 2), h5py.ref_dtype)
        cells[:] = np.full((2, 2), file.create_group("#refs#/a").ref, dtype=h5py.ref_dtype)


def deep_groups(path: Path) -> None:
    with h5py.File(path, "w") as file:
        group = file
        for _ in range(2000):
            group = group.create_group("a")
        group["histogram"] = np.ones((16, 2, 2), np.uint8)


def group_in_itself(path: Path) -> None:
    with h5py.File(path, "w") as file:
        group = file.create_group("a")
        group["again"] = group
        group["up"] = file["/"]


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def _matrix(kind: int, shape: tuple[int, ...], name: bytes, data: bytes) -> bytes:
    flags = _element(6, struct.pack("<II", kind, 0))
    sides = _element(5, struct.pack(f"<{len(shape)}i", *shape))
    return _element(14, flags + sides + _element(1, name) + data)


def _write_mat(path: Path, matrix: bytes) -> None:
    packed = zlib.compress(matrix, 9)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)


def large_cell_of_mat(path: Path) -> None:
    """Write four cells of 100 MB of zeros, as bytes that become 800 MB of numbers."""
    zeros = _matrix(6, (1, 100 * MB), b"", _element(2, bytes(100 * MB)))
    _write_mat(path, _matrix(1, (2, 2), b"photons", 4 * zeros))


def large_struct_of_mat(path: Path) -> None:
    zeros = _matrix(6, (1, 100 * MB), b"", _element(2, bytes(100 * MB)))
    fields = _element(5, struct.pack("<i", 8)) + _element(1, b"a".ljust(8, b"\0"))
    inner = _matrix(2, (1, 1), b"", fields + zeros)
    _write_mat(path, _matrix(1, (2, 2), b"photons", 4 * inner))


def deep_cells(path: Path) -> None:
    inner = _matrix(6, (1, 1), b"", _element(2, b"\1"))
    for _ in range(3000):
        inner = _matrix(1, (1, 1), b"", inner)
    _write_mat(path, _matrix(1, (2, 2), b"photons", 4 * inner))


def long_name_of_mat(path: Path) -> None:
    _write_mat(path, _matrix(6, (2, 2), bytes(200 * MB), _element(9, bytes(32))))


def large_matrix_of_mat(path: Path) -> None:
    scipy.io.savemat(path, {"cube": np.zeros((500, 500, 250), "f8")}, do_compression=True)


def _npy(shape: tuple[int, ...], dtype: str) -> bytes:
    file = io.BytesIO()
    facts = {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, facts)
    return file.getvalue()


def wide_text_of_npz(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("histogram.npy", _npy((16, 2, 2), "|u1") + bytes(64))
        archive.writestr("orientation.npy", _npy((1,), f"<U{100 * MB}") + bytes(400 * MB))


def header_of_brackets(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        text = b"(" * 9000
        head = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text))
        archive.writestr("histogram.npy", head + text)


BULKY: dict[str, Callable[[Path], None]] = {
    "wide_texts.h5": wide_texts,
    "wide_attribute.h5": wide_attribute,
    "large_chunk.h5": large_chunk,
    "chunk_beyond_its_array.h5": chunk_beyond_its_array,
    "large_cells.h5": large_cells_of_hdf5,
    "cells_of_groups.h5": cells_of_groups,
    "deep_groups.h5": deep_groups,
    "group_in_itself.h5": group_in_itself,
    "large_cell.mat": large_cell_of_mat,
    "large_struct.mat": large_struct_of_mat,
    "deep_cells.mat": deep_cells,
    "long_name.mat": long_name_of_mat,
    "large_matrix.mat": large_matrix_of_mat,
    "wide_text.npz": wide_text_of_npz,
    "header_of_brackets.npz": header_of_brackets,
}
"""Name of a file -> who writes it."""
