"""What was found in cells, laid over pixels: lights put in, their streaks taken out.

    veil and streaks of cells -> rows of pixels, linear between the middles of cells
    lights of pixels          -> put there, in colours that the output has

Every pixel follows from the cells and its own place alone: bands of any height have the same bits.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.colorimetry import Matrix
from camkit.contracts import FloatArray
from camkit.streaks.cells import COLOURS, PITCH_PX
from camkit.streaks.recovery import Recovery
from camkit.streaks.spots import lit_pixels

DIMMEST: Final = 0.1
"""Of its strongest colour: lights have no less of any in the colours of the output."""
_NO_CHANGE: Final = np.eye(3)


class Painter:
    """Lays a recovery over the rows of a picture; keeps no more of it than that needs."""

    def __init__(self, recovery: Recovery, to_output: Matrix = _NO_CHANGE) -> None:
        """Lay out the lights.

        Args:
            recovery: Of the capture.
            to_output: (3, 3) from colours multiplied by the gains to linear Rec.709, in which no
                light is negative.
        """
        self._lit = lit_pixels(recovery)
        self._to_output = to_output
        self._from_output = np.asarray(np.linalg.inv(to_output), np.float64)
        self._veil = recovery.veil
        self._veil_grid = recovery.coarse.pitch_px, recovery.coarse.offset_px
        self._streaks = [(region.window, region.streaks) for region in recovery.regions]
        self._offset_px = recovery.fine.offset_px
        self._core = recovery.core

    def paint(self, planes: FloatArray, top: int, gains: tuple[float, ...]) -> None:
        """Change rows of a picture in place.

        Args:
            planes: (3, rows, w) float32, full colour, multiplied by the gains.
            top: Number of the first row.
            gains: Of the colours.
        """
        pitch_px, offset_px = self._veil_grid
        rows, width = planes.shape[1:]
        for colour, gain in enumerate(gains):
            veil = self._veil[colour]
            under = _rows_of_cells(veil, pitch_px, offset_px[colour], top, rows, width)
            self._add_streaks(under, colour, top)
            under *= np.float32(gain)
            planes[colour] -= under
            planes[colour] *= np.float32(1 / self._core[colour])
        self._put_lights(planes, top, gains)

    def _add_streaks(self, under: FloatArray, colour: int, top: int) -> None:
        offset = self._offset_px[colour]
        for window, streaks in self._streaks:
            first = max(PITCH_PX * window.top - 1 - top, 0)
            last = min(PITCH_PX * window.bottom + 1 - top, under.shape[0])
            if first >= last or not streaks[colour].any():
                continue
            left, right = (
                max(PITCH_PX * window.left - 1, 0),
                min(PITCH_PX * window.right + 1, under.shape[1]),
            )
            moved = (offset[0] + PITCH_PX * window.top, offset[1] + PITCH_PX * window.left - left)
            under[first:last, left:right] += _rows_of_cells(
                streaks[colour], PITCH_PX, moved, top + first, last - first, right - left
            )

    def _put_lights(self, planes: FloatArray, top: int, gains: tuple[float, ...]) -> None:
        lit, rows = self._lit, planes.shape[1]
        first, last = np.searchsorted(lit.rows, [top, top + rows])
        if first == last:
            return
        at = lit.rows[first:last] - top, lit.columns[first:last]
        levels = np.array(gains, np.float32)[:, None]
        light = lit.light[:, first:last] * levels
        there = _untinted(np.where(light > 0, light, planes[:, *at]), light > 0)
        planes[:, *at] = _visible(there, self._to_output, self._from_output)


def _untinted(light: FloatArray, lit: NDArray[np.bool_]) -> FloatArray:
    """Raise what clipped to the darker of the other colours where one of these was seen.

    Which colours clip changes from pixel to pixel at the rim of a lamp: whatever is raised from
    white by too little there is tinted, green that clipped first makes it purple.

    Args:
        light: (3, n), multiplied by the gains.
        lit: (3, n): which colours clipped.
    """
    seen = ~lit.all(axis=0)
    out = light.copy()
    for colour in range(COLOURS):
        others = np.delete(light, colour, axis=0).min(axis=0)
        out[colour] = np.where(lit[colour] & seen, np.maximum(light[colour], others), light[colour])
    return out


def _visible(light: FloatArray, to_output: Matrix, from_output: Matrix) -> FloatArray:
    """Raise colours that were sought apart to where the output has them; (3, n) light."""
    seen = _turned(light, to_output)
    least = np.float32(DIMMEST) * seen.max(axis=0)
    short = (seen < least).any(axis=0) & (seen > 1).any(axis=0)
    raised = np.maximum(seen[:, short], least[short])
    out = light.copy()
    out[:, short] = _turned(raised, from_output)
    return out


def _turned(light: FloatArray, matrix: Matrix) -> FloatArray:
    """Multiply (3, n) light; a product of matrices may differ in a last bit with n."""
    rows = matrix.astype(np.float32)
    return np.stack([sum(a * plane for a, plane in zip(row, light, strict=True)) for row in rows])


def _rows_of_cells(
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
    for phase in range(pitch_px):
        columns = out[:, phase::pitch_px]
        place = (phase - offset_px) / pitch_px
        first = int(np.floor(place))
        share = np.float32(place - first)
        index = first + np.arange(columns.shape[1])
        low = np.clip(index, 0, lines.shape[1] - 1)
        high = np.clip(index + 1, 0, lines.shape[1] - 1)
        columns[...] = lines[:, low] * (1 - share) + lines[:, high] * share
    return out
