"""Captures of every packed type whose few bytes unpack to more than the memory holds."""

import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import sdtfile
import tifffile

from tests.spad_files import small_cube, write_sdt

MB = 1_000_000
SIDE = 25_000


def _deflated(byte_count: int) -> bytes:
    packer = zlib.compressobj(9)
    piece = bytes(MB)
    parts = [packer.compress(piece) for _ in range(byte_count // MB)]
    return b"".join([*parts, packer.flush()])


def one_strip(path: Path) -> None:
    """Write a TIFF whose one strip says that it is 0.6 GB, and is."""
    _write_tiff(path, SIDE, SIDE, [_deflated(SIDE * SIDE)])


def more_than_its_pixels(path: Path) -> None:
    """Write a TIFF of 16x16 pixels whose strip unpacks to 0.6 GB."""
    _write_tiff(path, 16, 16, [_deflated(600 * MB)])


def many_pages(path: Path) -> None:
    """Write a packed TIFF of 600 pages of 1000x1000 zeros, 0.6 GB in all."""
    with tifffile.TiffWriter(path) as file:
        page = np.zeros((1000, 1000), np.uint8)
        for _ in range(600):
            file.write(page, compression="zlib", photometric="minisblack", contiguous=False)


def packed_by_words(path: Path) -> None:
    """Write a TIFF of 0.6 GB in LZW, where few codes stand for much."""
    codes = bytes([128, 0, 64])
    _write_tiff(path, SIDE, SIDE, [codes * 1000], compression=5)


def _write_tiff(
    path: Path, width: int, height: int, strips: list[bytes], compression: int = 8
) -> None:
    entries = [
        *((256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8), (259, 3, 1, compression)),
        *((262, 3, 1, 1), (273, 4, 1, 8), (277, 3, 1, 1), (278, 4, 1, height)),
        (279, 4, 1, len(strips[0])),
    ]
    made = struct.pack("<H", len(entries))
    made += b"".join(struct.pack("<HHII", *entry) for entry in entries) + bytes(4)
    data = strips[0] + bytes(len(strips[0]) % 2)
    path.write_bytes(b"II*\0" + struct.pack("<I", 8 + len(data)) + data + made)


def zip_of_sdt(path: Path) -> None:
    """Write a zip whose SDT is 0.6 GB of zeros."""
    _zip(path, "scan.sdt", 600 * MB)


def zip_that_lies(path: Path) -> None:
    """Write a zip whose SDT announces 1 kB and unpacks to 0.6 GB."""
    _zip(path, "scan.sdt", 600 * MB)
    data = bytearray(path.read_bytes())
    for mark, at in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        place = data.find(mark) + at
        data[place : place + 4] = struct.pack("<I", 1000)
    path.write_bytes(data)


def packed_block_of_sdt(path: Path) -> None:
    """Write an SDT whose block is a zip of 0.6 GB."""
    write_sdt(path, small_cube())
    inner = path.with_suffix(".inner")
    _zip(inner, "data_block", 600 * MB)
    packed, data = inner.read_bytes(), bytearray(path.read_bytes())
    inner.unlink()
    header = np.frombuffer(
        data[: np.dtype(sdtfile.sdtfile.FILE_HEADER).itemsize],
        np.dtype(sdtfile.sdtfile.FILE_HEADER),
    )
    at = int(header["data_block_offs"][0])
    kind = np.dtype(sdtfile.sdtfile.BLOCK_HEADER)
    block = np.frombuffer(bytes(data[at : at + kind.itemsize]), kind).copy()
    block["next_block_offs"] = at + kind.itemsize + len(packed)
    block["block_type"] |= 0x1000
    block["block_length"] = 600_000_000
    path.write_bytes(bytes(data[:at]) + block.tobytes() + packed)


def cube_of_npz(path: Path) -> None:
    _zip_of_zeros(path, (1200, 1000, 500))


def more_than_its_header_says(path: Path) -> None:
    """Write an NPZ whose member is 0.6 GB, of which its header names 64 bytes."""
    _zip_of_zeros(path, (16, 2, 2), 600 * MB)


def _zip_of_zeros(path: Path, shape: tuple[int, ...], size: int | None = None) -> None:
    head = f"{{'descr': '|u1', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    head_bytes = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode()
    _zip(path, "histogram.npy", size or int(np.prod(shape)), head_bytes)


def _zip(path: Path, name: str, size: int, head: bytes = b"") -> None:
    piece = bytes(MB)
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open(name, "w") as file,
    ):
        file.write(head)
        for _ in range(size // MB):
            file.write(piece)


BOMBS: dict[str, Callable[[Path], None]] = {
    "one_strip.tif": one_strip,
    "more_than_its_pixels.tif": more_than_its_pixels,
    "many_pages.tif": many_pages,
    "packed_by_words.tif": packed_by_words,
    "zip_of_sdt.sdt.zip": zip_of_sdt,
    "zip_that_lies.sdt.zip": zip_that_lies,
    "packed_block.sdt": packed_block_of_sdt,
    "cube.npz": cube_of_npz,
    "more_than_its_header_says.npz": more_than_its_header_says,
}
"""Name of a file -> who writes it."""
