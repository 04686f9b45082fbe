"""Rows of pixels from cells, linear between their middles."""

import numpy as np

from camkit.contracts import FloatArray


def rows_of_cells(
    field: FloatArray,
    pitch_px: int,
    offset_px: tuple[float, float],
    top: int,
    rows: int,
    width: int,
) -> FloatArray:
    """Give rows of pixels (rows, width), linear between the middles of cells, even beyond them."""
    place = (np.arange(top, top + rows) - offset_px[0]) / pitch_px
    low = np.clip(np.floor(place).astype(int), 0, field.shape[0] - 1)
    high = np.minimum(low + 1, field.shape[0] - 1)
    share = np.clip(place - low, 0, 1).astype(np.float32)[:, None]
    lines = field[low] * (1 - share) + field[high] * share
    return _columns_of_cells(lines, pitch_px, offset_px[1], width)


def _columns_of_cells(lines: FloatArray, pitch_px: int, offset_px: float, width: int) -> FloatArray:
    """Give columns of pixels: those of one phase lie between their cells alike."""
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
