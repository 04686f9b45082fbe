"""Photons over time as frames: all bins or their sum, dark counts off, hot pixels painted over."""

import tempfile
from collections.abc import Iterator
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.runtime.cancel import check_wish
from camkit.runtime.job.stream import Stream
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture
from camkit.runtime.kinds.spad.captures.strips import KEPT_BYTES, pieces
from camkit.runtime.kinds.spad.hot_pixels import check_map, painted_over
from camkit.runtime.kinds.spad.pixels import Pixels, by_pixel

SHARE: Final = 0.4
"""Of the free memory: an array that takes more lies in a file while it is made."""


def frames_of(photons: Stream, capture: PhotonCapture) -> FloatArray:
    """Return the photons that a product shows.

    Args:
        photons: In the pixels of the array.
        capture: Whose product says whether they are summed over time.

    Returns:
        (bins or frames, h, w) float32; (1, h, w) of a histogram whose product is a picture.

    Raises:
        DecodeError: If the file is damaged, or holds no counts.
        ContractError: If what is stated of it cannot be true of it.
        Cancelled: If the caller wished so.
    """
    cap, pixels = capture.settings.max_mem_bytes, Pixels.of(photons)
    if is_summed(capture):
        frames = np.empty((1, *photons.shape[1:]), np.float32)
        for top, counts in _strips(photons, pixels, cap, frames.nbytes):
            frames[0, top : top + len(counts)] = counts.sum(axis=2, dtype=np.float64)
    else:
        frames = _room(photons.shape, cap)
        held_bytes = 0 if isinstance(frames, np.memmap) else frames.nbytes
        for top, counts in _strips(photons, pixels, cap, held_bytes):
            frames[:, top : top + len(counts)] = counts.transpose(2, 0, 1)
    check_map(pixels.hot)
    if pixels.hot.any():
        for frame in frames:
            frame[:] = painted_over(frame, pixels.hot)
    return frames


def is_summed(capture: PhotonCapture) -> bool:
    """Return whether a product shows the photons of all times together."""
    return capture.axis is not None and capture.product == "intensity"


def _strips(
    photons: Stream, pixels: Pixels, max_mem_bytes: int, held_bytes: int
) -> Iterator[tuple[int, FloatArray]]:
    """Yield first row and counts (rows, w, n) of strip after strip, without dark counts."""
    bins, height, width = photons.shape
    rows = photons.rows()
    for piece in pieces(
        (height, width), bins, reach=0, max_mem_bytes=max_mem_bytes, held_bytes=held_bytes
    ):
        check_wish()
        counts = by_pixel(rows.read(piece.top, piece.bottom))
        yield piece.top, counts - pixels.dark[piece.top : piece.bottom, :, None].astype(np.float32)


def _room(shape: tuple[int, int, int], max_mem_bytes: int) -> FloatArray:
    """Return an empty array: in memory, or in a file without a name where it is too large."""
    count = int(np.prod(shape))
    if 4 * count <= SHARE * (max_mem_bytes - KEPT_BYTES):
        return np.empty(shape, np.float32)
    with tempfile.TemporaryFile() as file:
        return np.memmap(file, dtype=np.float32, mode="w+", shape=shape)
