"""What was found in cells, laid over pixels: lights put in, their streaks taken out.

    veil of cells, streaks of lights -> taken from rows of pixels
    lights of pixels                 -> put there, in colours that the output has

Every pixel follows from the cells and its own place alone: bands of any height have the same bits.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.colorimetry import Matrix
from camkit.contracts import FloatArray
from camkit.streaks.cell_rows import rows_of_cells
from camkit.streaks.cells import COLOURS
from camkit.streaks.recovery import Recovery
from camkit.streaks.spots import lit_pixels
from camkit.streaks.thrown import streaks_of

DIMMEST: Final = 0.1
"""Of its strongest colour: lights have no less of any in the colours of the output."""
_NO_CHANGE: Final = np.eye(3)


class Painter:
    """Lays a recovery over the rows of a picture; keeps no more of it than that needs.

    Attributes:
        blind: Whether all lights are left as the sensor saw them.
    """

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
        self._streaks = streaks_of(recovery, self._lit)
        self._core = recovery.core
        self.blind = recovery.blind

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
            under = rows_of_cells(veil, pitch_px, offset_px[colour], top, rows, width)
            for streaks in self._streaks:
                streaks.add(under, colour, top)
            under *= np.float32(gain)
            planes[colour] -= under
            planes[colour] *= np.float32(1 / self._core[colour])
        self._put_lights(planes, top, gains)

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
