"""The part of the picture in which the board was seen."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.calibration.geometry.camera_model import FloatGrid

_CELL_PX = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """The part of the picture that the board covered.

    Attributes:
        radius_px: From the optical centre, to which corners of two pictures or more reach: what a
            single picture shows is checked by no other.
        corner_px: How far the farthest corner of the picture lies from the optical centre.
        share: Of the picture, within the boards.
    """

    radius_px: float
    corner_px: float
    share: float

    @property
    def is_whole(self) -> bool:
        """Return whether nothing has to be guessed."""
        return self.radius_px >= self.corner_px


def coverage_of(
    corners: FloatGrid, centre_px: tuple[float, float], size: tuple[int, int]
) -> Coverage:
    """Return the coverage of the picture by boards.

    Args:
        corners: (view, corner, 2) x, y in px, of two views or more.
        centre_px: x, y of the optical centre.
        size: Width and height.
    """
    farthest = np.sort(np.linalg.norm(corners - centre_px, axis=-1).max(axis=1))
    right, bottom = size[0] - 1, size[1] - 1
    ends = np.array([(0, 0), (right, 0), (0, bottom), (right, bottom)], dtype=np.float64)
    return Coverage(
        radius_px=float(farthest[-2]),
        corner_px=float(np.linalg.norm(ends - centre_px, axis=1).max()),
        share=float(seen_cells(corners, size).mean()),
    )


def seen_cells(corners: FloatGrid, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the cells of 4x4 px that lie within the hull of a board."""
    width, height = (-(-side // _CELL_PX) for side in size)
    cells = np.zeros((height, width), dtype=np.uint8)
    for view in corners:
        hull = cv2.convexHull((view / _CELL_PX).astype(np.float32))
        cv2.fillConvexPoly(cells, np.rint(hull).astype(np.int32), 1)
    return cells.astype(bool)
