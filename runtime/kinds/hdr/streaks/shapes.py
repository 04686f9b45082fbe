"""Lights of coarse cells as lights of finer ones: high in the middle of a clipped place.

Between cells of one pitch and of half of it: a coarse cell covers 2 x 2 fine ones; a last fine row
or column that no coarse one covers goes with its neighbour.
"""

from typing import Any, Final

import numpy as np
import scipy
from numpy.typing import NDArray

from camkit.arrays import FloatArray

DOME_PX: Final = 5.0
"""Farther from its rim a light rises no more."""
FARTHEST_CELLS: Final = 64
STRIP_ROWS: Final = 256
_ROUNDS: Final = 4
_TINY: Final = 1e-6


def rim_distance_px(mask: NDArray[np.bool_], pitch_px: float) -> FloatArray:
    """Return the distance of every cell of a mask (h, w) from its rim, 0 outside.

    Farther than `FARTHEST_CELLS` from a rim nothing grows, so that strips of rows can be measured
    one by one, in the memory of a few.
    """
    distance = np.zeros(mask.shape, np.float32)
    for top in range(0, mask.shape[0], STRIP_ROWS):
        start = max(top - FARTHEST_CELLS, 0)
        strip = mask[start : top + STRIP_ROWS + FARTHEST_CELLS]
        if strip.any():
            box, strip_distance = box_about(strip, 1), np.zeros(strip.shape)
            strip_distance[box] = scipy.ndimage.distance_transform_edt(strip[box])
            distance[top : top + STRIP_ROWS] = strip_distance[top - start :][:STRIP_ROWS]
    return np.minimum(distance, FARTHEST_CELLS) * np.float32(pitch_px)


def box_about(mask: NDArray[np.bool_], margin: int) -> tuple[slice, slice]:
    """Return the rows and columns of what is set in a mask (h, w), and so many about it."""
    ends = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    rows, columns = (slice(max(int(e[0]) - margin, 0), int(e[-1]) + 1 + margin) for e in ends)
    return rows, columns


def dome(distance_px: FloatArray) -> FloatArray:
    """Return the usual shape of lights, from the distance to their rim."""
    return np.asarray(np.minimum(distance_px, DOME_PX) ** 2, np.float32)


def pooled(fine: FloatArray) -> FloatArray:
    """Return the means of 2 x 2 cells of (..., h, w); a last odd row or column is left out."""
    height, width = fine.shape[-2] // 2, fine.shape[-1] // 2
    means = np.empty((*fine.shape[:-2], height, width), np.float32)
    for top in range(0, height, STRIP_ROWS):
        part = means[..., top : top + STRIP_ROWS, :]
        strip = fine[..., 2 * top : 2 * (top + part.shape[-2]), : 2 * width]
        np.add(strip[..., 0::2, 0::2], strip[..., 0::2, 1::2], out=part)
        part += strip[..., 1::2, 0::2] + strip[..., 1::2, 1::2]
        part *= np.float32(0.25)
    return means


def upsampled(coarse: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Return fine cells (h, w) of `shape`, linear between the middles of coarse ones."""
    return _doubled(_doubled(coarse, shape[0]).T, shape[1]).T


def repeated(coarse: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    """Return fine cells (h, w) of `shape`, each as the coarse one that covers it."""
    fine = np.repeat(np.repeat(coarse, 2, axis=0), 2, axis=1)
    more = [(0, max(side - have, 0)) for side, have in zip(shape, fine.shape, strict=True)]
    return np.pad(fine, more, mode="edge")


def with_means(base: FloatArray, means: FloatArray) -> FloatArray:
    """Return lights shaped like a base whose coarse cells have these means.

    Args:
        base: (h, w) >= 0, fine; 0 where there is no light.
        means: Of coarse cells.
    """
    light = base.copy()
    for _ in range(_ROUNDS):
        there = pooled(light)
        weight = (there > 0).astype(np.float32)
        ratio = np.divide(means, there, out=np.zeros_like(means), where=there > _TINY)
        smooth = upsampled(ratio * weight, base.shape)
        light *= smooth / np.maximum(upsampled(weight, base.shape), 0.1)
    return light


def _doubled(coarse: FloatArray, rows: int) -> FloatArray:
    """Return twice the rows, or a few more, linear between the middles of the given ones."""
    above = np.concatenate([coarse[:1], coarse[:-1]])
    below = np.concatenate([coarse[1:], coarse[-1:]])
    out = np.empty((2 * coarse.shape[0], coarse.shape[1]), np.float32)
    out[0::2] = 0.75 * coarse + 0.25 * above
    out[1::2] = 0.75 * coarse + 0.25 * below
    if rows > out.shape[0]:
        out = np.concatenate([out, np.repeat(out[-1:], rows - out.shape[0], axis=0)])
    return out[:rows]


def widened(plane: NDArray[Any], down: int, right: int) -> NDArray[Any]:
    """Return the largest value so many rows and columns around, (h, w) numbers or a mask."""
    out = plane
    for axis, reach in enumerate((down, right)):
        wide = out.copy()
        for shift in range(1, reach + 1):
            for target, there in ((np.s_[shift:], np.s_[:-shift]), (np.s_[:-shift], np.s_[shift:])):
                part = wide[target] if axis == 0 else wide[:, target]
                np.maximum(part, out[there] if axis == 0 else out[:, there], out=part)
        out = wide
    return out
