"""Photons along time or over frames, without dark counts and hot pixels, with frames first."""

import tempfile
from collections.abc import Iterator
from typing import Final

import numpy as np

from camkit.contracts import FloatArray
from camkit.runtime.cancel import check_cancelled
from camkit.runtime.kinds.spad.finer.pictures import finer_frames
from camkit.runtime.kinds.spad.hot_pixels import check_map, painted_over
from camkit.runtime.kinds.spad.products.strips import KEPT_BYTES, check_room, pieces
from camkit.runtime.kinds.spad.products.survey import Survey
from camkit.runtime.maker import Making

FINE_BYTES_OF_COUNT: Final = 80
"""What a count of the array takes on the fine grid."""
SHARE: Final = 0.4
"""Of the free memory: an array that takes more lies in a file while it is made."""


def frames_of(making: Making, survey: Survey) -> FloatArray:
    """Return all photons, (bins or frames, h, w) float32.

    Raises:
        DecodeError: If the file is damaged, or holds no counts.
        ContractError: If what is stated of it cannot be true of it.
        Cancelled: If the caller wished so.
    """
    found = _room((survey.bins, *survey.shape), survey.settings.max_mem_bytes)
    held = 0 if isinstance(found, np.memmap) else found.nbytes
    for top, counts in _strips(making, survey, held):
        found[:, top : top + len(counts)] = counts.transpose(2, 0, 1)
    return _sound(found, survey)


def full_pixels(survey: Survey) -> tuple[str, ...]:
    """Return what the user should know of pixels that counted in every cycle."""
    blind = survey.rows.blind_pixels
    if not blind:
        return ()
    return (f"pile-up is too strong to correct in {blind} pixels: their photons are a lower bound",)


def sum_of(making: Making, survey: Survey) -> FloatArray:
    """Return the photons of every pixel, (1, h, w) float32; errors as of `frames_of`."""
    found = np.empty((1, *survey.shape), np.float32)
    for top, counts in _strips(making, survey, found.nbytes):
        found[0, top : top + len(counts)] = counts.sum(axis=2, dtype=np.float64)
    return _sound(found, survey)


def made_finer(making: Making, survey: Survey, frames: FloatArray) -> FloatArray:
    """Return pictures (n, h, w) on the fine grid of the bundle; without one as they are.

    Raises:
        ContractError: If they do not fit the memory.
        Cancelled: If the caller wished so.
    """
    if survey.camera is None:
        return frames
    check_room(survey.shape, len(frames), FINE_BYTES_OF_COUNT, survey.settings.max_mem_bytes)
    of_frame = survey.bins if survey.axis is not None and len(frames) == 1 else 1
    return finer_frames(
        survey.camera,
        frames,
        survey.timing.dark(survey.shape) * of_frame,
        survey.size_of_pictures,
        progress=making.progress,
        cancel=making.cancel,
    )


def _strips(making: Making, survey: Survey, held_bytes: int) -> Iterator[tuple[int, FloatArray]]:
    """Yield first row and counts (rows, w, n) of strip after strip."""
    dark = survey.timing.dark(survey.shape)
    for piece in pieces(
        survey.shape,
        survey.bins,
        reach=0,
        max_mem_bytes=survey.settings.max_mem_bytes,
        held_bytes=held_bytes,
    ):
        check_cancelled(making.cancel)
        strip = survey.rows.rows(piece.top, piece.bottom)
        yield piece.top, strip.counts - dark[piece.top : piece.bottom, :, None].astype(np.float32)
        if making.progress is not None:
            making.progress(piece.bottom, survey.shape[0])


def _sound(frames: FloatArray, survey: Survey) -> FloatArray:
    hot = survey.timing.hot(survey.shape)
    check_map(hot)
    if hot.any():
        for frame in frames:
            frame[:] = painted_over(frame, hot)
    return frames


def _room(shape: tuple[int, int, int], max_mem_bytes: int) -> FloatArray:
    """Return an empty array: in memory, or in a file without a name where it is too large."""
    count = int(np.prod(shape))
    if 4 * count <= SHARE * (max_mem_bytes - KEPT_BYTES):
        return np.empty(shape, np.float32)
    with tempfile.TemporaryFile() as file:
        return np.memmap(file, dtype=np.float32, mode="w+", shape=shape)
