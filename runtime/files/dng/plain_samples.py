"""Samples of a DNG that are read without LibRaw: floats, deflated ones, planes that lie apart.

LibRaw scales floats by their largest sample, takes Deflate without a predictor for one with, and
mixes up planes that lie apart.

    strips or tiles -> zlib, in bounds -> predictor undone -> numbers at their place
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from camkit.errors import DecodeError
from camkit.runtime.files.dng.picture_tags import DngPicture, first_of, numbers_of
from camkit.runtime.files.dng.predictors import as_floats, as_whole_numbers, unpredicted
from camkit.runtime.files.dng.readable import DEFLATE


@dataclass(frozen=True, slots=True, kw_only=True)
class _Chunk:
    """A strip or tile: where its bytes lie, and its samples."""

    offset: int
    byte_count: int
    place: tuple[int, int, int]
    shape: tuple[int, int, int]


def read_plain(path: Path, picture: DngPicture) -> NDArray[Any]:
    """Return (h, w, plane) samples of the whole picture: float32, or uint16 of whole numbers.

    Args:
        path: The file, whose strips and tiles are known to lie inside.
        picture: Its sensor picture, which `check_readable` has passed.

    Raises:
        DecodeError: If the samples are damaged or their layout cannot be.
        OSError: If the file cannot be read.
    """
    size = picture.height, picture.width, picture.planes
    out = np.zeros(size, np.float32 if picture.is_float else np.uint16)
    with path.open("rb") as file:
        big_endian = file.read(2) == b"MM"
        for chunk in _chunks(picture):
            numbers = _numbers(file, chunk, picture, big_endian=big_endian)
            top, left, plane = chunk.place
            room = out[top:, left:, plane : plane + chunk.shape[2]]
            part = numbers[: room.shape[0], : room.shape[1]]
            room[: part.shape[0], : part.shape[1]] = part
    return out


def _chunks(picture: DngPicture) -> Iterator[_Chunk]:
    """Yield the strips or tiles of a picture, each plane after the other if they lie apart."""
    tags, (height, width) = picture.directory, (picture.height, picture.width)
    tiled = 324 in tags
    offsets = numbers_of(tags, 324 if tiled else 273)
    counts = numbers_of(tags, 325 if tiled else 279)
    tall = int(first_of(tags, 323 if tiled else 278, height))
    wide = int(first_of(tags, 322, width)) if tiled else width
    tall = tall if tiled else min(tall, height)
    per_chunk, groups = (1, picture.planes) if picture.is_planar else (picture.planes, 1)
    if min(tall, wide) < 1 or max(tall, wide) > 1 << 16:
        raise DecodeError(f"strips or tiles of {wide}x{tall} pixels cannot be; header damaged?")
    places = [
        (top, left, plane)
        for plane in range(groups)
        for top in range(0, height, tall)
        for left in range(0, width, wide)
    ]
    if len(offsets) != len(places) or len(counts) != len(places):
        raise DecodeError(
            f"{width}x{height} pixels need {len(places)} strips or tiles, there are "
            f"{len(offsets)}; the header is damaged"
        )
    for place, offset, count in zip(places, offsets, counts, strict=True):
        rows = tall if tiled else min(tall, height - place[0])
        yield _Chunk(
            offset=int(offset), byte_count=int(count), place=place, shape=(rows, wide, per_chunk)
        )


def _numbers(
    file: BinaryIO, chunk: _Chunk, picture: DngPicture, *, big_endian: bool
) -> NDArray[Any]:
    """Return (row, column, plane) numbers of a strip or tile."""
    rows, columns, planes = chunk.shape
    expected = rows * columns * planes * picture.bits // 8
    file.seek(chunk.offset)
    data = file.read(chunk.byte_count)
    deflated = picture.compression in DEFLATE
    if deflated:
        inflater = zlib.decompressobj()
        try:
            data = inflater.decompress(data, expected)
            inflater.decompress(inflater.unconsumed_tail, 1)  # its end holds the checksum
        except zlib.error as error:
            raise DecodeError(f"the pixel data are damaged: {error}") from error
        if len(data) == expected and not inflater.eof:
            raise DecodeError(
                f"a strip or tile holds more than the {expected} bytes that its size and depth "
                "need; it is damaged"
            )
    if len(data) < expected:
        raise DecodeError(
            f"a strip or tile holds {len(data)} bytes of pixels, its size and depth need "
            f"{expected}; it is damaged"
        )
    predictor = int(first_of(picture.directory, 317, 1)) if deflated else 1
    octets = unpredicted(data, chunk.shape, picture.bits, predictor, big_endian=big_endian)
    numbers = as_floats(octets) if picture.is_float else as_whole_numbers(octets)
    return numbers.reshape(chunk.shape)
