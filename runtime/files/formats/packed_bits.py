"""Samples of 1 to 15 bits, packed without gaps; every row begins with a new byte.

References: TIFF 6.0, sections 3 (packing), 8 (FillOrder), 15 (tiles). The first sample lies in the
highest bits of the first byte whatever the byte order of the file; FillOrder 2 turns every byte.
"""

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import DecodeError
from camkit.runtime.files.formats.tiff_page import (
    DEFLATE,
    OLD_DEFLATE,
    PLAIN,
    TiffPage,
)

_BLOCK_ROWS: Final = 256
_OFFSETS, _LENGTHS, _ROWS_PER_STRIP = 273, 279, 278
_TILE_WIDTH, _TILE_HEIGHT, _TILE_OFFSETS, _TILE_LENGTHS = 322, 323, 324, 325
_FILL_ORDER: Final = 266
_LOW_BITS_FIRST: Final = 2
_REVERSED: Final = np.packbits(
    np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], 1)[:, ::-1], 1
)

Codec = Callable[[bytes], bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Grid:
    """Strips or tiles: where their bytes are, and how many samples a row and rows each has."""

    offsets: tuple[int, ...]
    lengths: tuple[int, ...]
    width: int
    height: int
    across: int
    down: int


def read_packed(path: Path, page: TiffPage, codec: Codec | None) -> NDArray[np.uint16]:
    """Read the samples of a page.

    Args:
        path: The TIFF.
        page: Of samples of less than 16 bits.
        codec: Takes the compression off a strip or tile; None for none and Deflate.

    Returns:
        (sample, h, w) uint16.

    Raises:
        DecodeError: If strips or tiles are missing or too short.
    """
    if page.predictor != 1:
        raise DecodeError(f"samples of {page.bits} bits with a predictor are not read")
    grid = _grid(page)
    wide, high = page.size_px
    planes = page.samples if page.is_planar else 1
    each = page.samples // planes
    samples = np.zeros((planes, high, wide, each), dtype=np.uint16)
    count = grid.across * grid.down
    if min(len(grid.offsets), len(grid.lengths)) < planes * count:
        raise DecodeError(
            f"the TIFF lists {len(grid.offsets)} strips or tiles, expected {planes * count}: its "
            "header is damaged"
        )
    with path.open("rb") as file:
        for number in range(planes * count):
            plane, (down, across) = number // count, divmod(number % count, grid.across)
            top, left = down * grid.height, across * grid.width
            rows = grid.height if _TILE_OFFSETS in page.tags else min(grid.height, high - top)
            if grid.offsets[number] == grid.lengths[number] == 0:
                continue  # a sparse one, of which the page tells
            file.seek(grid.offsets[number])
            part = _unpacked(file.read(grid.lengths[number]), page, codec, (rows, grid.width, each))
            samples[plane, top : top + rows, left : left + grid.width] = part[
                : high - top, : wide - left
            ]
    return np.moveaxis(samples, -1, 1).reshape(page.samples, high, wide)


def _grid(page: TiffPage) -> _Grid:
    wide, high = page.size_px
    tiled = _TILE_OFFSETS in page.tags
    width = page.number_of(_TILE_WIDTH, 0) if tiled else wide
    height = page.number_of(_TILE_HEIGHT, 0) if tiled else page.number_of(_ROWS_PER_STRIP, high)
    height = height if tiled else min(height, high)
    if not (1 <= width <= 2 * wide + 65536 and 1 <= height <= 2 * high + 65536):
        raise DecodeError(f"tiles or strips of {width}x{height} px: the header is damaged")
    return _Grid(
        offsets=page.numbers(_TILE_OFFSETS if tiled else _OFFSETS),
        lengths=page.numbers(_TILE_LENGTHS if tiled else _LENGTHS),
        width=width,
        height=height,
        across=-(-wide // width),
        down=-(-high // height),
    )


def _unpacked(
    data: bytes, page: TiffPage, codec: Codec | None, shape: tuple[int, int, int]
) -> NDArray[np.uint16]:
    """Return the (rows, w, sample) of one strip or tile."""
    rows, width, each = shape
    count = width * each
    row_bytes = -(-count * page.bits // 8)
    if page.number_of(_FILL_ORDER, 1) == _LOW_BITS_FIRST:
        data = _REVERSED.ravel()[np.frombuffer(data, np.uint8)].tobytes()
    if codec is not None:
        data = codec(data)
    elif page.compression in (DEFLATE, OLD_DEFLATE):
        try:
            data = zlib.decompressobj().decompress(data, rows * row_bytes)
        except zlib.error as error:
            raise DecodeError(f"a strip or tile is damaged: {error}") from error
    elif page.compression != PLAIN:
        raise DecodeError(f"samples of {page.bits} bits with compression {page.compression}")
    if len(data) < rows * row_bytes:
        raise DecodeError(
            f"a strip or tile holds {len(data)} of {rows * row_bytes} bytes: the file is damaged"
        )
    packed = np.frombuffer(data, np.uint8, rows * row_bytes).reshape(rows, row_bytes)
    blocks = [
        unpack_rows(packed[top : top + _BLOCK_ROWS], count, page.bits)
        for top in range(0, rows, _BLOCK_ROWS)
    ]
    return np.concatenate(blocks).reshape(rows, width, each)


def unpack_rows(rows: NDArray[np.uint8], count: int, bits: int) -> NDArray[np.uint16]:
    """Unpack rows of samples.

    Args:
        rows: (row, byte).
        count: Samples of a row.
        bits: Of a sample, 1 to 16.

    Returns:
        (row, count) uint16.
    """
    first = np.arange(count) * bits
    at, shift = first // 8, (24 - bits - first % 8).astype(np.uint32)
    padded = np.pad(rows, ((0, 0), (0, 2))).astype(np.uint32)
    words = padded[:, at] << 16 | padded[:, at + 1] << 8 | padded[:, at + 2]
    return ((words >> shift) & np.uint32((1 << bits) - 1)).astype(np.uint16)
