"""Spectra of periodic blocks: the only place of the bank where Fourier transforms are done.

    (3, b, b) samples -> transform -> (3, b, b // 2 + 1) half spectrum -> inverse -> samples

OpenCV transforms real planes into a packed plane of the same size, with Intel's library where it
has it: less than half the time of scipy's transform for a block of 384 px. In a packed plane of
width w the real spectra of column 0 (and of column w / 2 if w is even) lie packed along the rows
in its first (and last) column; all others lie as pairs (re, im) between them:

    packed   | column 0 | re 1 | im 1 | re 2 | im 2 | ... | column w / 2 |
    half     |    0     |      1      |      2      | ... |     w / 2    |
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray

ComplexArray = NDArray[np.complex64]

_INVERSE: Final = cv2.DFT_INVERSE | cv2.DFT_REAL_OUTPUT


def transform(planes: FloatArray) -> ComplexArray:
    """Give the spectrum of real planes, as `numpy.fft.rfft2` does.

    Args:
        planes: (c, h, w) float32; not changed.

    Returns:
        (c, h, w // 2 + 1) complex64.
    """
    packed = _pack(planes)
    c, h, w = planes.shape
    half = np.empty((c, h, w // 2 + 1), dtype=np.complex64)
    half[:, :, 1 : 1 + (w - 1) // 2] = _pairs(packed)
    for column, frequency in _packed_columns(w):
        half[:, :, frequency] = _unpack_column(packed[:, :, column])
    return half


def inverse(half: ComplexArray, width: int) -> FloatArray:
    """Give the real planes of a spectrum, as `numpy.fft.irfft2` does.

    Args:
        half: (c, h, w // 2 + 1) complex64 of `transform`; not changed.
        width: w.

    Returns:
        (c, h, w) float32.
    """
    packed = np.empty((*half.shape[:2], width), dtype=np.float32)
    _pairs(packed)[:] = half[:, :, 1 : 1 + (width - 1) // 2]
    for column, frequency in _packed_columns(width):
        packed[:, :, column] = _pack_column(half[:, :, frequency])
    return _unpack(packed)


def apply_transfer(samples: FloatArray, transfer: ComplexArray) -> FloatArray:
    """Multiply the spectrum of periodic planes by a transfer function.

    Args:
        samples: (c, h, w) float32.
        transfer: (c, h, w // 2 + 1) complex64, Hermitian as `transform` gives it.

    Returns:
        (c, h, w) float32.
    """
    packed = _pack(samples)
    width = samples.shape[2]
    pairs = _pairs(packed)
    pairs *= transfer[:, :, 1 : 1 + (width - 1) // 2]
    for column, frequency in _packed_columns(width):
        line = _unpack_column(packed[:, :, column])
        packed[:, :, column] = _pack_column(line * transfer[:, :, frequency])
    return _unpack(packed)


def _pack(planes: FloatArray) -> FloatArray:
    packed = np.empty(planes.shape, dtype=np.float32)
    for plane, out in zip(planes, packed, strict=True):
        cv2.dft(np.ascontiguousarray(plane), dst=out)
    return packed


def _unpack(packed: FloatArray) -> FloatArray:
    planes = np.empty_like(packed)
    for plane, out in zip(packed, planes, strict=True):
        cv2.dft(plane, dst=out, flags=_INVERSE)
    planes *= np.float32(1 / (planes.shape[1] * planes.shape[2]))
    return planes


def _pairs(packed: FloatArray) -> ComplexArray:
    """View the columns that hold (re, im)."""
    count = (packed.shape[2] - 1) // 2
    return packed[:, :, 1 : 1 + 2 * count].view(np.complex64)


def _packed_columns(width: int) -> list[tuple[int, int]]:
    """Give (packed column, frequency) of the columns that hold the spectrum of a real line."""
    return [(0, 0)] if width % 2 else [(0, 0), (width - 1, width // 2)]


def _unpack_column(lines: FloatArray) -> ComplexArray:
    """Give the whole spectrum (c, h) of packed lines: re 0, re 1, im 1, ..., [re h / 2]."""
    count, height = lines.shape
    spectrum = np.zeros((count, height), dtype=np.complex64)
    spectrum.real[:, 0] = lines[:, 0]
    inner = (height - 1) // 2
    spectrum.real[:, 1 : 1 + inner] = lines[:, 1 : 1 + 2 * inner : 2]
    spectrum.imag[:, 1 : 1 + inner] = lines[:, 2 : 2 + 2 * inner : 2]
    if height % 2 == 0:
        spectrum.real[:, height // 2] = lines[:, -1]
    spectrum[:, height - inner :] = np.conj(spectrum[:, 1 : 1 + inner][:, ::-1])
    return spectrum


def _pack_column(spectrum: ComplexArray) -> FloatArray:
    """Undo `_unpack_column`; of a spectrum of no real line, its real line's part is taken."""
    count, height = spectrum.shape
    lines = np.empty((count, height), dtype=np.float32)
    lines[:, 0] = spectrum.real[:, 0]
    inner = (height - 1) // 2
    low, high = spectrum[:, 1 : 1 + inner], spectrum[:, height - inner :][:, ::-1]
    lines[:, 1 : 1 + 2 * inner : 2] = 0.5 * (low.real + high.real)
    lines[:, 2 : 2 + 2 * inner : 2] = 0.5 * (low.imag - high.imag)
    if height % 2 == 0:
        lines[:, -1] = spectrum.real[:, height // 2]
    return lines
