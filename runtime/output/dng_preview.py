"""The small picture that a DNG shows where nobody develops it: averages of its samples, as sRGB."""

import math
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from camkit.arrays import FloatArray
from camkit.colorimetry import apply_matrix, rec709_from_camera
from camkit.runtime.color import encode_uint8
from camkit.runtime.output.jpeg import encode_jpeg

LONGEST_SIDE_PX: Final = 1024
QUALITY: Final = 85


class Averages:
    """Takes (c, rows, w) bands from top to bottom and keeps the averages of square blocks.

    Rows and columns beyond the last whole block count for none.
    """

    def __init__(
        self, height: int, width: int, *, least_step: int = 1, longest_px: int = LONGEST_SIDE_PX
    ) -> None:
        """Prepare for a picture.

        Args:
            height: Rows that will come.
            width: Their columns.
            least_step: Least side of the blocks, where the picture has such a side.
            longest_px: Most rows and columns of the averages.
        """
        step = max(least_step, math.ceil(max(height, width) / longest_px))
        self._step_y, self._step_x = min(step, height), min(step, width)
        self._columns = width // self._step_x
        self._waiting: NDArray[Any] | None = None
        self._averages: list[FloatArray] = []

    def add(self, band: NDArray[Any]) -> None:
        """Add the next rows: (c, rows, w) uint16 or float32."""
        rows = band if self._waiting is None else np.concatenate([self._waiting, band], axis=1)
        count = rows.shape[1] // self._step_y
        if count:
            whole_blocks = rows[:, : count * self._step_y, : self._columns * self._step_x]
            self._averages.append(np.stack([self._shrunk(plane, count) for plane in whole_blocks]))
        self._waiting = rows[:, count * self._step_y :].copy()

    def planes(self) -> FloatArray:
        """Return (c, h, w) float32 of what has come, at most `longest_px` each way."""
        return np.concatenate(self._averages, axis=1)

    def _shrunk(self, plane: NDArray[Any], rows: int) -> FloatArray:
        small = cv2.resize(
            np.ascontiguousarray(plane), (self._columns, rows), interpolation=cv2.INTER_AREA
        )
        return np.asarray(small, dtype=np.float32).reshape(rows, self._columns)


def preview_jpeg(
    planes: FloatArray, scale: tuple[float, float, float], matrix: NDArray[np.float64] | None
) -> bytes:
    """Return a preview as sRGB.

    Args:
        planes: (3, h, w) float32 DN above black, camera RGB.
        scale: Factor per channel to white-balanced RGB with 1.0 = white.
        matrix: (3, 3) XYZ (D65) to camera; None where the samples are Rec.709.
    """
    linear = planes * np.array(scale, dtype=np.float32)[:, None, None]
    np.minimum(linear, 1.0, out=linear)  # what clipped is white, whatever its gain
    if matrix is not None:
        linear = apply_matrix(rec709_from_camera(matrix), linear)
    codes = encode_uint8(linear, tone="srgb").transpose(1, 2, 0)
    return encode_jpeg(Image.fromarray(np.ascontiguousarray(codes)), quality=QUALITY)
