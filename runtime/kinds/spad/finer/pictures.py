"""Pictures of photons on the fine grid: by a network, or linearly at their level of light."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from camkit.arrays import FloatArray
from camkit.bundle.stages.super_resolve import SURE
from camkit.runtime.cancel import Cancel, check_cancelled
from camkit.runtime.kinds.spad.finer.camera import FineCamera, white_of

EMPTY: Final = 0.0
"""Photons of a frame, dark counts taken off: with fewer there is nothing to see."""

Step = Callable[[int, int], None]


def where_light_is(frame: FloatArray, dark: NDArray[np.floating] | float = 0.0) -> float:
    """Return the photons of a pixel (h, w) where photons are: their mean, weighed by themselves.

    Chance alone adds one photon to that, which is taken off, and so are dark counts.

    Args:
        frame: Photons, without dark counts.
        dark: Those, (h, w) or one number.
    """
    counts = np.asarray(frame + dark, np.float64)
    weighed = float(np.square(counts).sum()) / max(float(counts.sum()), 1e-12)
    mean = max(float(frame.sum(dtype=np.float64)) / counts.size, 0.0)
    return max(weighed - 1 - float(np.mean(dark)), mean)


def finer_frames(
    camera: FineCamera,
    frames: FloatArray,
    dark: NDArray[np.floating] | float,
    size: str | None,
    *,
    white: float | None = None,
    progress: Step | None = None,
    cancel: Cancel | None = None,
) -> FloatArray:
    """Return pictures (n, m h, m w) of photons (n, h, w), >= 0.

    Frames without photons stay dark and take no time.

    Args:
        camera: The array.
        frames: Photons of a pixel, without dark counts.
        dark: Dark counts that were taken off, (h, w) or one number.
        size: Of the network; None for the linear estimate.
        white: Photons of white, for networks; None for what the frames show.
        progress: Called with (frames done, frames in all).
        cancel: Asked between frames.

    Raises:
        Cancelled: If `cancel` said so.
    """
    scale, (count, height, width) = camera.scale, frames.shape
    pictures = np.zeros((count, scale * height, scale * width), np.float32)
    white = white_of(frames) if white is None else white
    for number, frame in enumerate(frames):
        check_cancelled(cancel)
        photons = float(frame.sum(dtype=np.float64))
        if photons > EMPTY:
            one = frame[None]
            pictures[number] = (
                camera.linear(where_light_is(frame, dark))(one)[0]
                if size is None
                else camera.by_network(one, size, white=white, dark=dark, cancel=cancel)[0]
            )
        if progress is not None:
            progress(number + 1, count)
    np.maximum(pictures, 0, out=pictures)
    if camera.stage.floor > 0:
        for picture, frame in zip(pictures, frames, strict=True):
            np.maximum(picture, least_light(camera, frame, dark), out=picture)
    return pictures


def least_light(
    camera: FineCamera, frame: FloatArray, dark: NDArray[np.floating] | float
) -> FloatArray:
    """Return (m h, m w), the least photons of sub-pixels: no black where light was counted.

    Beside bright points estimates of unit sum fall below zero; what was counted around them says
    that they are wrong there.

    Args:
        camera: The array.
        frame: (h, w) photons, without dark counts.
        dark: Those, (h, w) or one number.
    """
    counts = np.maximum(frame + dark, 0)
    sure = np.maximum(counts - SURE * np.sqrt(counts + 1) - dark, 0)
    darkest = minimum_filter(sure, 3, mode="nearest")
    share = np.float32(camera.stage.floor)
    return np.asarray(np.kron(share * darkest, np.ones((camera.scale,) * 2)), np.float32)
