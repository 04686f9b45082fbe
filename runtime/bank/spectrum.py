"""Spectra of periodic blocks: the only place of the bank where Fourier transforms are done.

    (3, b, b) samples -> transform -> (3, b, b // 2 + 1) half spectrum -> inverse -> samples

OpenCV transforms real planes into a packed plane of the same size, with Intel's library where it
has it: less than half the time of scipy's transform for a block of 384 px. In a packed plane of
width w the real spectra of column 0 (and of column w / 2 if w is even) lie packed along the rows
in its first (and last) column; all others lie as pairs (re, im) between them:

    packed   | column 0 | re 1 | im 1 | re 2 | im 2 | ... | column w / 2 |
    half     |    0     |      1      |      2      | ... |     w / 2    |

Whoever weighs a spectrum by real numbers alone does so in packed planes, in which a weight stands
at both parts of its frequency (`spread_weights`): nothing is sorted, and no product is complex.
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray

ComplexArray = NDArray[np.complex64]

_INVERSE: Final = cv2.DFT_INVERSE | cv2.DFT_REAL_OUTPUT


def transform(planes: FloatArray) -> ComplexArray:
    """Return the spectrum of real planes, as `numpy.fft.rfft2` does.

    Args:
        planes: (c, h, w) float32; not changed.

    Returns:
        (c, h, w // 2 + 1) complex64.
    """
    packed = to_packed(planes)
    c, h, w = planes.shape
    half = np.empty((c, h, w // 2 + 1), dtype=np.complex64)
    half[:, :, 1 : 1 + (w - 1) // 2] = _pairs(packed)
    for column, frequency in _packed_columns(w):
        half[:, :, frequency] = _unpack_column(packed[:, :, column])
    return half


def inverse(half: ComplexArray, width: int) -> FloatArray:
    """Return the real planes of a spectrum, as `numpy.fft.irfft2` does.

    Args:
        half: (c, h, w // 2 + 1) complex64 of `transform`; not changed.
        width: w.

    Returns:
        (c, h, w) float32.
    """
    return from_packed(packed_spectrum(half, width))


def apply_transfer(samples: FloatArray, transfer: ComplexArray) -> FloatArray:
    """Multiply the spectrum of periodic planes by a transfer function.

    Args:
        samples: (c, h, w) float32.
        transfer: (c, h, w // 2 + 1) complex64, Hermitian as `transform` gives it.

    Returns:
        (c, h, w) float32.
    """
    packed = to_packed(samples)
    width = samples.shape[2]
    pairs = _pairs(packed)
    pairs *= transfer[:, :, 1 : 1 + (width - 1) // 2]
    for column, frequency in _packed_columns(width):
        line = _unpack_column(packed[:, :, column])
        packed[:, :, column] = _pack_column(line * transfer[:, :, frequency])
    return from_packed(packed)


def to_packed(planes: FloatArray) -> FloatArray:
    """Return the spectra of real planes (c, h, w) float32 in packed planes of the same shape."""
    packed = np.empty(planes.shape, dtype=np.float32)
    for plane, out in zip(planes, packed, strict=True):
        cv2.dft(np.ascontiguousarray(plane), dst=out)
    return packed


def from_packed(packed: FloatArray) -> FloatArray:
    """Undo `to_packed`."""
    planes = np.empty_like(packed)
    for plane, out in zip(packed, planes, strict=True):
        cv2.dft(plane, dst=out, flags=_INVERSE)
    planes *= np.float32(1 / (planes.shape[1] * planes.shape[2]))
    return planes


def packed_spectrum(half: ComplexArray, width: int) -> FloatArray:
    """Return the half spectrum (c, h, w // 2 + 1) of real planes in packed planes (c, h, w)."""
    packed = np.empty((*half.shape[:2], width), dtype=np.float32)
    _pairs(packed)[:] = half[:, :, 1 : 1 + (width - 1) // 2]
    for column, frequency in _packed_columns(width):
        packed[:, :, column] = _pack_column(half[:, :, frequency])
    return packed


def packed_power(packed: FloatArray) -> FloatArray:
    """Return the power of spectra in packed planes (c, h, w), at both parts of every frequency."""
    power = np.square(packed)
    for column, _ in _packed_columns(packed.shape[2]):
        _sum_pairs(power[:, :, column])
    _sum_pairs(power)
    return power


def _sum_pairs(lines: FloatArray) -> None:
    """Replace both re and im by their sum; lines as in `_unpack_column`."""
    count = (lines.shape[-1] - 1) // 2
    re, im = (lines[..., first : first + 2 * count : 2] for first in (1, 2))
    both = re + im
    re[...] = both
    im[...] = both


def spread_weights(half: FloatArray, width: int) -> FloatArray:
    """Return real weights (c, h, w // 2 + 1), alike at f and -f, for packed planes (c, h, w)."""
    inner, height = (width - 1) // 2, half.shape[1]
    spread = np.empty((*half.shape[:2], width), dtype=np.float32)
    for weights, plane in zip(half[:, :, 1 : 1 + inner], spread, strict=True):
        if inner:  # OpenCV merges no empty planes
            plane[:, 1 : 1 + 2 * inner] = cv2.merge((weights, weights)).reshape(height, -1)
    rows = (np.arange(height) + 1) // 2  # 0, 1, 1, 2, 2, ..., [h / 2]
    for column, frequency in _packed_columns(width):
        spread[:, :, column] = half[:, rows, frequency]
    return spread


def packed_places(
    rows: NDArray[np.intp], columns: NDArray[np.intp], size: tuple[int, int]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the indices of real and imaginary parts in a packed plane, flattened.

    Args:
        rows: Of the half spectrum.
        columns: Likewise; below half of w.
        size: (h, w) of the planes; no frequency given may be its own mirror image.

    Returns:
        Places of the real parts and of the imaginary ones, the latter up to their sign.
    """
    height, width = size
    first = np.minimum(rows, height - rows)
    real = np.where(columns > 0, rows * width + 2 * columns - 1, (2 * first - 1) * width)
    return real, np.where(columns > 0, real + 1, real + width)


def multiply_conjugate(packed: FloatArray, other: FloatArray) -> FloatArray:
    """Multiply spectra by the conjugates of others, all in packed planes (c, h, w)."""
    product = np.empty_like(packed)
    for a, b, out in zip(packed, other, product, strict=True):
        cv2.mulSpectrums(a, b, 0, out, conjB=True)
    return product


def _pairs(packed: FloatArray) -> ComplexArray:
    """View the columns that hold (re, im)."""
    count = (packed.shape[2] - 1) // 2
    return packed[:, :, 1 : 1 + 2 * count].view(np.complex64)


def _packed_columns(width: int) -> list[tuple[int, int]]:
    """Return (packed column, frequency) of the columns that hold the spectrum of a real line."""
    return [(0, 0)] if width % 2 else [(0, 0), (width - 1, width // 2)]


def _unpack_column(lines: FloatArray) -> ComplexArray:
    """Return the whole spectrum (c, h) of packed lines: re 0, re 1, im 1, ..., [re h / 2]."""
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
