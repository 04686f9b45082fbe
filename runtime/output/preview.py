"""A small 8-bit sRGB picture, made while the bands of the large one pass by."""

from dataclasses import replace
from pathlib import Path
from typing import Final, Self

import numpy as np

from camkit.colorimetry import apply_matrix
from camkit.contracts import FloatArray
from camkit.runtime.color import color_stage, to_rec709
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.output.png import PngWriter

MAX_SIDE_PX: Final = 1600


class PreviewWriter:
    """Averages squares of pixels in linear light and writes them as 8-bit PNG."""

    def __init__(
        self, path: Path, picture: PictureFormat, *, max_side_px: int = MAX_SIDE_PX
    ) -> None:
        self._factor = max(1, -(-max(picture.width, picture.height) // max_side_px))
        self._to_rec709 = to_rec709(picture.color)
        self._waiting = np.empty((3, 0, picture.width), dtype=np.float32)
        small = replace(
            picture,
            width=-(-picture.width // self._factor),
            height=-(-picture.height // self._factor),
            color=color_stage(None),
            tone="srgb",
        )
        self._png = PngWriter(path, small, bits=8)

    def write(self, band: FloatArray) -> None:
        """Take the next (3, rows, w) band of linear output colour."""
        rows = np.concatenate([self._waiting, band], axis=1)
        whole = rows.shape[1] // self._factor * self._factor
        self._waiting = rows[:, whole:].copy()
        if whole:
            self._put(rows[:, :whole])

    def close(self) -> None:
        """Complete the file; the last square may be cut."""
        if self._waiting.shape[1]:
            self._put(self._waiting)
        self._png.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self.release()

    def release(self) -> None:
        """Let go of the file as it is, after an error."""
        self._png.release()

    def _put(self, rows: FloatArray) -> None:
        small = average_squares(rows, self._factor)
        self._png.write(apply_matrix(self._to_rec709, small))


def average_squares(planes: FloatArray, factor: int) -> FloatArray:
    """Give (c, h, w) averaged over squares of `factor` pixels; squares at the ends may be cut."""
    _, height, width = planes.shape
    rows, columns = np.arange(0, height, factor), np.arange(0, width, factor)
    sums = np.add.reduceat(np.add.reduceat(planes, rows, axis=1), columns, axis=2)
    counts = np.outer(np.diff([*rows, height]), np.diff([*columns, width]))
    return np.asarray(sums / counts, dtype=np.float32)
