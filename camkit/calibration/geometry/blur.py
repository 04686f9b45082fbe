"""Blur of the edges of a board whose corners are roughly known.

An edge lies half way between two neighbouring corners. Its light rises from one side to the other
over the blur: for a Gaussian, the greatest slope is the step / (sigma sqrt(2 pi)).
"""

import math
from typing import Final

import cv2
import numpy as np

from camkit.arrays import FloatArray
from camkit.calibration.geometry.board import Board
from camkit.calibration.geometry.camera_model import FloatGrid

_SIDE: Final = 0.5
"""Of the way between two corners: how far from an edge its sides are looked at."""
_NEAR_PX: Final = 1.0
_LEAST_SLOPE: Final = 1e-9


def blur_px(grey: FloatArray, corners: FloatGrid, board: Board) -> float:
    """Estimate the sigma of the blur, that of the pixels included; infinite without edges.

    Args:
        grey: (h, w).
        corners: (corner, 2) x, y in px.
        board: What they belong to.
    """
    grid = corners.reshape(board.rows, board.columns, 2)
    pairs = [(grid[:, :-1], grid[:, 1:]), (grid[:-1], grid[1:])]
    one = np.concatenate([first.reshape(-1, 2) for first, _ in pairs])
    other = np.concatenate([second.reshape(-1, 2) for _, second in pairs])
    middle, along = (one + other) / 2, other - one
    way = np.linalg.norm(along, axis=1, keepdims=True)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(way, 1)
    steps = _light(grey, middle + across * way * _SIDE) - _light(
        grey, middle - across * way * _SIDE
    )
    rises = _light(grey, middle + across * _NEAR_PX) - _light(grey, middle - across * _NEAR_PX)
    slope = float(np.median(rises * np.sign(steps))) / (2 * _NEAR_PX)
    if slope <= _LEAST_SLOPE:
        return math.inf
    return float(np.median(np.abs(steps))) / slope / math.sqrt(2 * math.pi)


def _light(grey: FloatArray, places: FloatGrid) -> FloatGrid:
    x, y = (np.ascontiguousarray(places[:, i], dtype=np.float32) for i in (0, 1))
    light = cv2.remap(grey, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(light, dtype=np.float64).ravel()
