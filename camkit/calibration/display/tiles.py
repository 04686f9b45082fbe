"""The remaining shift between a capture and its picture, tile by tile, in px of the capture."""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import DecodeError

FloatGrid = NDArray[np.float64]

TILES: Final = 8
"""Along the longer side of what is seen."""
LEAST_TILES: Final = 4
SURE_PX: Final = 0.2
"""Standard error of a shift, in samples, above which a tile says too little."""
SMOOTH: Final = 1.4
"""Samples by which both are blurred, since differences of neighbours fall short of sharp slopes."""
_SLOPE: Final = np.array([1, -8, 0, 8, -1]) / 12
_NONE: Final = np.ones(1)
_LEAST_SAMPLES: Final = 100


def tile_shifts(
    grey: FloatArray, model: FloatGrid, inside: NDArray[np.bool_]
) -> tuple[FloatGrid, FloatGrid]:
    """Measure the shift of the capture against its model, tile by tile.

    Args:
        grey: (h, w) the capture.
        model: (h, w) what it should be.
        inside: (h, w) where.

    Returns:
        (tile, 2) middles x, y and (tile, 2) shifts, in samples, of the tiles that tell theirs.

    Raises:
        DecodeError: If fewer than `LEAST_TILES` do.
    """
    rows, columns = np.nonzero(inside)
    top, left = int(rows.min()), int(columns.min())
    bottom, right = int(rows.max()) + 1, int(columns.max()) + 1
    side = max(8, -(-max(bottom - top, right - left) // TILES))
    observed, smooth = (
        cv2.GaussianBlur(part.astype(np.float32), (0, 0), SMOOTH) for part in (grey, model)
    )
    slopes = [
        cv2.sepFilter2D(smooth, -1, *kernels) for kernels in ((_SLOPE, _NONE), (_NONE, _SLOPE))
    ]
    places, shifts = [], []
    for y in range(top, bottom, side):
        for x in range(left, right, side):
            window = np.s_[y : min(y + side, bottom), x : min(x + side, right)]
            here = inside[window]
            if np.count_nonzero(here) < max(_LEAST_SAMPLES, here.size // 2):
                continue
            parts = [part[window][here].astype(np.float64) for part in (observed, smooth, *slopes)]
            shift = _shift(parts)
            if shift is not None:
                down, across = np.nonzero(here)
                places.append((x + across.mean(), y + down.mean()))
                shifts.append(shift)
    if len(places) < LEAST_TILES:
        raise DecodeError(
            f"{len(places)} places of the picture show enough to tell how well it lies on its "
            f"capture, {LEAST_TILES} are needed: show a picture with more in it"
        )
    return np.array(places), np.array(shifts)


def _shift(parts: list[FloatGrid]) -> FloatGrid | None:
    """Return the shift x, y of a tile; None where it cannot be determined."""
    observed, model, along, down = parts
    columns = np.column_stack([-along, -down, model, np.ones_like(model)])
    normal = columns.T @ columns
    if np.linalg.cond(normal) > 1e14:
        return None
    solution = np.linalg.solve(normal, columns.T @ (observed - model))
    rest = observed - model - columns @ solution
    spread = np.linalg.inv(normal)[:2, :2] * (rest @ rest) / max(len(observed) - 4, 1)
    if not np.sqrt(max(np.trace(spread), 0.0)) < SURE_PX:
        return None
    return np.asarray(solution[:2])
