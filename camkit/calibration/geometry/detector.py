"""The inner corners of a board in a picture: found on a small copy, refined on the whole one.

    picture -> copies of at most `LARGEST_PX`, half of it, a quarter
      -> the sector-based detector, which finds blurred boards too; else the older one
      -> every corner where gradients around it agree (cornerSubPix), or the saddle of strong blur

The window of a corner is a share of the way to its nearest neighbour: one that reaches the next
corner is drawn to it. Both ways of refining see a picture that is smoothed about as much as it is
blurred already: gradients of noise draw corners to the middles of their windows.

References: Duda and Frese 2018, "Accurate detection and localization of checkerboard corners";
    Foerstner and Guelch 1987.
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.calibration.geometry.blur import blur_px
from camkit.calibration.geometry.board import Board
from camkit.calibration.geometry.camera_model import FloatGrid
from camkit.calibration.geometry.grey import to_codes
from camkit.calibration.geometry.saddle import refine_saddles

Codes = NDArray[np.uint8]
Corners = NDArray[np.float32]

LARGEST_PX: Final = 1600
SMALLEST_PX: Final = 240
WINDOW: Final = 0.25
"""Half a window, of the way to the nearest corner."""
LEAST_WINDOW_PX: Final = 2
ROUNDED: Final = 0.08
"""Sigma of the blur, of that way, from which on corners are saddles. Below it pictures are smoothed
by as much as they are blurred, but not beyond this."""
SADDLE_PER_BLUR: Final = 2.0
"""Radius around a saddle, of the sigma of the blur."""
WIDEST_SADDLE: Final = 0.5
"""The same, of the way to the nearest corner."""
MOST_BLUR: Final = 0.5
"""Of that way, beyond which there is no edge between two corners."""
LEAST_SMOOTHING_PX: Final = 0.3
MOST_MOVE: Final = 0.35
"""Of that way, that refinement may move a corner; farther, it is another place."""
LEAST_WAY_PX: Final = 5.0
_STOP: Final = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-4)


def find_corners(grey: FloatArray, board: Board) -> FloatGrid | None:
    """Find a board.

    Args:
        grey: (h, w).
        board: What to look for.

    Returns:
        (corner, 2) x, y in px, row by row of the board; None if it is not there.
    """
    codes = to_codes(grey)
    copies = _copies(codes)
    for find in (_by_sectors, _by_sectors_evened, _by_squares, _by_sectors_thoroughly):
        for factor, small in copies:
            rough = find(small, (board.columns, board.rows))
            if rough is None:
                continue
            refined = refine(grey, _unfolded(rough, factor), board)
            if refined is not None:
                return refined
    return None


def _copies(codes: Codes) -> list[tuple[int, Codes]]:
    """Return the scale and the smaller picture; the largest first."""
    height, width = codes.shape
    factor = -(-max(codes.shape) // LARGEST_PX)
    copies: list[tuple[int, Codes]] = []
    while not copies or max(codes.shape) >= SMALLEST_PX * factor:
        whole = codes[: height // factor * factor, : width // factor * factor]
        size = (width // factor, height // factor)
        small = codes if factor == 1 else cv2.resize(whole, size, interpolation=cv2.INTER_AREA)
        copies.append((factor, np.asarray(small, dtype=np.uint8)))
        factor *= 2
    return copies


def _by_sectors(small: Codes, corner_counts: tuple[int, int], flags: int = 0) -> Corners | None:
    is_board, corners = cv2.findChessboardCornersSB(small, corner_counts, flags=flags)
    return corners if is_board else None


def _by_sectors_evened(small: Codes, corner_counts: tuple[int, int]) -> Corners | None:
    """Find a board in a picture of even histogram, which helps in uneven light only."""
    return _by_sectors(small, corner_counts, cv2.CALIB_CB_NORMALIZE_IMAGE)


def _by_sectors_thoroughly(small: Codes, corner_counts: tuple[int, int]) -> Corners | None:
    return _by_sectors(small, corner_counts, cv2.CALIB_CB_EXHAUSTIVE)


def _by_squares(small: Codes, corner_counts: tuple[int, int]) -> Corners | None:
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    is_board, corners = cv2.findChessboardCorners(small, corner_counts, flags=flags)
    return corners if is_board else None


def _unfolded(corners: Corners, factor: int) -> FloatGrid:
    """Return the places on the whole picture; pixel centres are at integers."""
    return (corners.reshape(-1, 2).astype(np.float64) + 0.5) * factor - 0.5


def refine(grey: FloatArray, rough: FloatGrid, board: Board) -> FloatGrid | None:
    """Refine corners.

    Args:
        grey: (h, w).
        rough: (corner, 2) x, y in px.
        board: What they belong to.

    Returns:
        (corner, 2) x, y in px; None if they are no corners, or too close to one another.
    """
    ways = nearest_px(rough, board)
    if ways.min() < LEAST_WAY_PX:
        return None
    blur, way = blur_px(grey, rough, board), float(np.median(ways))
    if not blur <= MOST_BLUR * way:
        return None
    if blur > ROUNDED * way:
        radius = min(SADDLE_PER_BLUR * blur, WIDEST_SADDLE * way)
        refined = refine_saddles(_smoothed(grey, blur), rough, radius)
    else:
        smooth = _smoothed(grey, min(blur, np.sqrt(max((ROUNDED * way) ** 2 - blur**2, 0))))
        halves = np.maximum(LEAST_WINDOW_PX, np.rint(WINDOW * ways)).astype(int)
        refined = _by_gradients(smooth, _by_gradients(smooth, rough, halves), halves)
    moves = np.linalg.norm(refined - rough, axis=1)
    is_lost = not np.isfinite(refined).all() or bool((moves > MOST_MOVE * ways).any())
    return None if is_lost else refined


def _smoothed(grey: FloatArray, sigma_px: float) -> FloatArray:
    """Blur a picture further."""
    if sigma_px < LEAST_SMOOTHING_PX:
        return grey
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), sigma_px), dtype=np.float32)


def _by_gradients(grey: FloatArray, rough: FloatGrid, halves: NDArray[np.int_]) -> FloatGrid:
    """Refine every corner within its own window; NaN for those outside the picture."""
    refined = rough.copy()
    inside = ((rough >= 0) & (rough <= np.array(grey.shape[::-1]) - 1)).all(axis=1)
    refined[~inside] = np.nan
    for half in np.unique(halves[inside]):
        mine = (halves == half) & inside
        at = np.ascontiguousarray(rough[mine], dtype=np.float32).reshape(-1, 1, 2)
        cv2.cornerSubPix(grey, at, (int(half), int(half)), (-1, -1), _STOP)
        refined[mine] = at.reshape(-1, 2)
    return refined


def nearest_px(corners: FloatGrid, board: Board) -> FloatGrid:
    """Return the vector (corner,) from every corner to its nearest neighbour on the board."""
    grid = corners.reshape(board.rows, board.columns, 2)
    near = np.full(grid.shape[:2], np.inf)
    down = np.linalg.norm(np.diff(grid, axis=0), axis=-1)
    across = np.linalg.norm(np.diff(grid, axis=1), axis=-1)
    near[:-1] = np.minimum(near[:-1], down)
    near[1:] = np.minimum(near[1:], down)
    near[:, :-1] = np.minimum(near[:, :-1], across)
    near[:, 1:] = np.minimum(near[:, 1:], across)
    return near.ravel()
