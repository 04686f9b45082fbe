"""Pixels from cells, linear between their middles: of every place or of a colour's samples."""

from dataclasses import dataclass

import numpy as np

from camkit.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Lattice:
    """Pixels of a picture: every `step_px`-th in rows and columns.

    Attributes:
        top: Row of the first pixel.
        left: Column of the first pixel.
        step_px: Between pixels.
    """

    top: int = 0
    left: int = 0
    step_px: int = 1

    def pixels_in(
        self, box: tuple[int, int, int, int], shape: tuple[int, ...]
    ) -> tuple[slice, slice]:
        """Return a mask of the pixels that lie in a box (top, left, bottom, right) of the picture.

        Args:
            box: In pixels.
            shape: Of the lattice, (rows, columns).
        """
        ends = (box[0], box[2], self.top, shape[0]), (box[1], box[3], self.left, shape[1])
        rows, columns = (
            slice(*(int(np.clip(-((start - end) // self.step_px), 0, many)) for end in (low, high)))
            for low, high, start, many in ends
        )
        return rows, columns

    def part(self, at: tuple[slice, slice]) -> "Lattice":
        """Return some of the pixels."""
        top, left = (self.step_px * pixels.start for pixels in at)
        return Lattice(top=self.top + top, left=self.left + left, step_px=self.step_px)

    def cells(
        self,
        field: FloatArray,
        pitch_px: int,
        offset_px: tuple[float, float],
        shape: tuple[int, ...],
    ) -> FloatArray:
        """Return the light of cells at the pixels; see `rows_of_cells`."""
        step = self.step_px
        offset = (offset_px[0] - self.top) / step, (offset_px[1] - self.left) / step
        return rows_of_cells(field, pitch_px // step, offset, 0, shape[0], shape[1])


def rows_of_cells(
    field: FloatArray,
    pitch_px: int,
    offset_px: tuple[float, float],
    top: int,
    rows: int,
    width: int,
) -> FloatArray:
    """Return rows of pixels (rows, width), linear between cell middles, even beyond them."""
    place = (np.arange(top, top + rows) - offset_px[0]) / pitch_px
    low = np.clip(np.floor(place).astype(int), 0, field.shape[0] - 1)
    high = np.minimum(low + 1, field.shape[0] - 1)
    share = np.clip(place - low, 0, 1).astype(np.float32)[:, None]
    lines = field[low] * (1 - share) + field[high] * share
    return _columns_of_cells(lines, pitch_px, offset_px[1], width)


def _columns_of_cells(lines: FloatArray, pitch_px: int, offset_px: float, width: int) -> FloatArray:
    """Return columns of pixels: those of one phase lie between their cells alike."""
    out = np.empty((lines.shape[0], width), np.float32)
    before = max(-int(np.floor(-offset_px / pitch_px)), 0)
    last = int(np.floor((width - 1 - offset_px) / pitch_px)) + 1
    after = max(last + 1 - lines.shape[1], 0)
    even = np.pad(lines, ((0, 0), (before, after)), mode="edge")
    for phase in range(pitch_px):
        columns = out[:, phase::pitch_px]
        place = (phase - offset_px) / pitch_px
        first = int(np.floor(place))
        share = np.float32(place - first)
        low, high = (
            even[:, k : k + columns.shape[1]] for k in (before + first, before + first + 1)
        )
        np.multiply(low, 1 - share, out=columns)
        columns += high * share
    return out
