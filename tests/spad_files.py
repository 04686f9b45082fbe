"""Captures of single photons in every type of file that is read, small and made here."""

import zipfile
from pathlib import Path

import h5py
import numpy as np
import ptufile
import scipy.io
import sdtfile
import tifffile

BINS, HEIGHT, WIDTH = 40, 9, 11


def small_cube(seed: int = 0) -> np.ndarray:
    """Give (t, y, x) uint16 counts with a pulse in the middle."""
    t = np.arange(BINS)[:, None, None]
    mean = 4 * np.exp(-(((t - 20) / 3) ** 2)) + 0.1 + np.zeros((1, HEIGHT, WIDTH))
    return np.asarray(np.random.default_rng(seed).poisson(mean), dtype=np.uint16)


def write_npz(path: Path, cube: np.ndarray) -> None:
    np.savez(path, histogram=cube)


def write_packed_npz(path: Path, cube: np.ndarray) -> None:
    np.savez_compressed(path, histogram=cube)


def write_h5(path: Path, cube: np.ndarray) -> None:
    with h5py.File(path, "w") as file:
        made = file.create_dataset("scan/histogram", data=cube, compression="gzip")
        made.attrs["time_bin_ps"] = 20.0


def write_mat5(path: Path, cube: np.ndarray) -> None:
    scipy.io.savemat(path, {"cube": cube.transpose(1, 2, 0), "width": 0.35}, do_compression=True)


def write_mat73(path: Path, cube: np.ndarray) -> None:
    """Write what MATLAB would of a variable (y, x, t): HDF5 with its axes reversed."""
    with h5py.File(path, "w", userblock_size=512) as file:
        made = file.create_dataset("cube", data=cube.transpose(0, 2, 1))
        made.attrs["MATLAB_class"] = np.bytes_("uint16")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def write_tiff(path: Path, cube: np.ndarray) -> None:
    tifffile.imwrite(path, cube, photometric="minisblack")


def write_packed_tiff(path: Path, cube: np.ndarray) -> None:
    tifffile.imwrite(path, cube, photometric="minisblack", compression="zlib")


def write_ptu(path: Path, cube: np.ndarray) -> None:
    period_s = 20e-12 * len(cube)
    ptufile.imwrite(path, np.ascontiguousarray(cube.transpose(1, 2, 0)), period_s, 20e-12)


def write_sdt(path: Path, cube: np.ndarray) -> None:
    """Write the least that is an SDT: header, one block of a measured image, its set-up."""
    data = np.ascontiguousarray(cube.transpose(1, 2, 0)).astype("<u2")
    header = np.zeros(1, np.dtype(sdtfile.sdtfile.FILE_HEADER))
    info = b"*IDENTIFICATION\r\n  ID : \x04SPC DLL Data File\x04\r\n*END\r\n"
    measure = np.zeros(1, np.dtype(sdtfile.sdtfile.MEASURE_INFO))
    measure["scan_x"], measure["scan_y"] = data.shape[1], data.shape[0]
    measure["image_x"], measure["image_y"] = data.shape[1], data.shape[0]
    measure["adc_re"], measure["tac_r"], measure["tac_g"] = data.shape[2], 20e-12 * data.shape[2], 1
    measure["incr"] = 1
    block = np.zeros(1, np.dtype(sdtfile.sdtfile.BLOCK_HEADER))
    at = header.dtype.itemsize
    header["info_offs"], header["info_length"] = at, len(info)
    at += len(info)
    header["meas_desc_block_offs"] = at
    header["meas_desc_block_length"] = measure.dtype.itemsize
    header["no_of_meas_desc_blocks"] = 1
    at += measure.dtype.itemsize
    header["data_block_offs"] = at
    header["no_of_data_blocks"], header["header_valid"] = 1, 0x5555
    header["data_block_length"] = data.nbytes
    block["data_offs"] = at + block.dtype.itemsize
    block["next_block_offs"] = at + block.dtype.itemsize + data.nbytes
    block["block_length"] = data.nbytes
    block["block_type"] = 0x01 | 0x10
    parts = [header.tobytes(), info, measure.tobytes(), block.tobytes(), data.tobytes()]
    path.write_bytes(b"".join(parts))


def write_sdt_zip(path: Path, cube: np.ndarray) -> None:
    plain = path.with_name("to_be_packed")
    write_sdt(plain, cube)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(plain, "scan.sdt")
    plain.unlink()


def stamps_of(cube: np.ndarray) -> np.ndarray:
    """Give cells (y, x) of the bin of every photon, as MATLAB has them: (n, 1), or (1, 0)."""
    cells = np.empty(cube.shape[1:], dtype=object)
    for y, x in np.ndindex(cells.shape):
        bins = np.repeat(np.arange(len(cube)), cube[:, y, x]).astype(np.int32)
        cells[y, x] = bins[:, None] if bins.size else np.zeros((1, 0))
    return cells


def write_cells5(path: Path, cube: np.ndarray) -> None:
    scipy.io.savemat(path, {"photons": stamps_of(cube), "pulses": 1500.0})


def write_cells73(path: Path, cube: np.ndarray) -> None:
    with h5py.File(path, "w") as file:
        cells = stamps_of(cube).T
        made = file.create_dataset("photons", cells.shape, h5py.ref_dtype)
        made.attrs["MATLAB_class"] = np.bytes_("cell")
        for number, (i, j) in enumerate(np.ndindex(cells.shape)):
            cell = cells[i, j]
            item = file.create_dataset(f"#refs#/{number}", data=cell.T if cell.size else [1, 0])
            if not cell.size:
                item.attrs["MATLAB_empty"] = np.uint8(1)
            made[i, j] = item.ref


WRITERS = {
    "cube.npz": write_npz,
    "packed.npz": write_packed_npz,
    "cube.h5": write_h5,
    "v5.mat": write_mat5,
    "v73.mat": write_mat73,
    "stack.tif": write_tiff,
    "packed.tif": write_packed_tiff,
    "scan.ptu": write_ptu,
    "scan.sdt": write_sdt,
    "scan.sdt.zip": write_sdt_zip,
}
"""Name of a file -> who writes a cube (t, y, x) into it."""
STAMPS = {"cells5.mat": write_cells5, "cells73.mat": write_cells73}
"""The same for files that hold the bin of every photon as its time stamp."""
AXES = {".mat": "yxt"}
"""What must be said of arrays whose axes are not known."""
