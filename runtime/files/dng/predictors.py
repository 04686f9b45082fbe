"""Bytes of a decompressed strip or tile as numbers: predictors undone, float16, 24 and 32 read.

predictor 1          numbers as they are
2, 34892, 34893      each the difference from the one before it, or 2 or 4 pixels before it
3, 34894, 34895      differences of bytes, the highest bytes of a row first

TIFF 6.0, section 14; TIFF Technical Note 3 (Adobe 2005); DNG specification 1.7.1, chapter 3.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

PIXELS_BACK: Final = {1: 0, 2: 1, 34892: 2, 34893: 4, 3: 1, 34894: 2, 34895: 4}
"""Predictor -> distance of the pixels that it takes differences of."""
OF_BYTES: Final = (3, 34894, 34895)


def unpredicted(
    data: bytes, shape: tuple[int, int, int], bits: int, predictor: int, *, big_endian: bool
) -> NDArray[np.uint8]:
    """Return (row, number of the row, byte) with the highest byte first.

    Args:
        data: At least as many bytes as the shape needs.
        shape: (rows, columns, planes).
        bits: 8, 16, 24 or 32.
        predictor: One of `PIXELS_BACK`.
        big_endian: Order of bytes in the file.
    """
    rows, columns, planes = shape
    size, count = bits // 8, columns * planes
    stored = np.frombuffer(data, np.uint8, rows * count * size)
    back = PIXELS_BACK[predictor] * planes
    if predictor in OF_BYTES:
        octets = _summed(stored.reshape(rows, count * size), back)
        return np.ascontiguousarray(np.swapaxes(octets.reshape(rows, size, count), 1, 2))
    octets = stored.reshape(rows, count, size)
    if not big_endian:
        octets = octets[..., ::-1]
    if not back:
        return np.ascontiguousarray(octets)
    words = np.zeros((rows, count), dtype=np.uint32)
    for place in range(size):
        words = (words << np.uint32(8)) | octets[..., place]
    whole = _summed(words, back).astype(">u4")[..., None].view(np.uint8)
    return np.ascontiguousarray(whole[..., 4 - size :])


def _summed(rows: NDArray[np.unsignedinteger], back: int) -> NDArray[np.unsignedinteger]:
    """Return running sums of every `back`-th number of each row; they wrap as differences do."""
    out = rows.copy()
    for first in range(back):
        np.cumsum(rows[:, first::back], axis=1, dtype=rows.dtype, out=out[:, first::back])
    return out


def as_floats(octets: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return (row, number) float32 of (row, number, byte), 2, 3 or 4 bytes, the highest first."""
    size = octets.shape[2]
    if size != 3:
        return octets.view(f">f{size}")[..., 0].astype(np.float32)
    word = np.zeros(octets.shape[:2], dtype=np.uint32)
    for place in range(3):
        word = (word << np.uint32(8)) | octets[..., place]
    exponent, mantissa = (word >> 16) & 0x7F, word & 0xFFFF
    value = np.ldexp(1 + mantissa / 65536, exponent.astype(np.int32) - 63)
    value = np.where(exponent == 0, np.ldexp(mantissa / 65536, -62), value)
    value = np.where(exponent == 0x7F, np.where(mantissa, np.nan, np.inf), value)
    return np.where(word >> 23, -value, value).astype(np.float32)


def as_whole_numbers(octets: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Return (row, number) uint16 of (row, number, byte), 1 or 2 bytes, the highest first."""
    if octets.shape[2] == 1:
        return octets[..., 0].astype(np.uint16)
    return octets.view(">u2")[..., 0].astype(np.uint16)
