"""The samples of one colour on the lattice on which the sensor has them.

Red and blue of a mosaic lie on a square lattice of two pixels, green on one of root two pixels
turned by 45 degrees, planes on that of the pixels. No colour is ever interpolated with the help of
another. Between samples a cubic spline goes through what a fitted Gaussian core leaves: a core is
narrow for the lattice of a colour, its rest is not.

References: Unser 1999, "Splines: a perfect fit for signal and image processing".
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from camkit.cfa import CfaPattern, cfa_channels

FloatGrid = NDArray[np.float64]

SPLINE_ORDER: Final = 3
GREEN: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Lattice:
    """Samples of one colour.

    Attributes:
        values: (row, column) float64 on the lattice; NaN where there is none.
        matrix: (2, 2) from pixels (y, x) to the lattice (row, column).
        shift: (2,) added after it.
    """

    values: FloatGrid
    matrix: FloatGrid
    shift: FloatGrid

    @classmethod
    def of_plane(cls, plane: FloatGrid) -> Self:
        """Return the lattice of a whole plane."""
        return cls(values=plane, matrix=np.eye(2), shift=np.zeros(2))

    @classmethod
    def of_mosaic(cls, mosaic: FloatGrid, cfa: CfaPattern, colour: int) -> Self:
        """Return the lattice of a colour of a (h, w) mosaic: 0 red, 1 green, 2 blue."""
        cell = np.array(cfa_channels(cfa))
        if colour != GREEN:
            top, left = (int(n) for n in np.argwhere(cell == colour)[0])
            shift = -np.array([top, left]) / 2
            return cls(values=mosaic[top::2, left::2], matrix=np.eye(2) / 2, shift=shift)
        odd = int(cell[0, 0] != GREEN)  # of row + column, where green lies
        matrix = np.array([[0.5, 0.5], [0.5, -0.5]])
        y, x = np.nonzero(np.indices(mosaic.shape).sum(axis=0) % 2 == odd)
        shift = np.array([-odd / 2, mosaic.shape[1] // 2 - odd / 2])
        row, column = (np.rint(part).astype(int) for part in _lattice_places(matrix, shift, y, x))
        turned = np.full((row.max() + 1, column.max() + 1), np.nan)
        turned[row, column] = mosaic[y, x]
        return cls(values=turned, matrix=matrix, shift=shift)

    @property
    def pitch_px(self) -> float:
        """Return the root of the area of a sample, in pixels."""
        return float(np.abs(np.linalg.det(self.matrix)) ** -0.5)

    def places(self) -> tuple[FloatGrid, FloatGrid]:
        """Return (y, x) in pixels of every sample, each of the shape of `values`."""
        inverse = np.linalg.inv(self.matrix)
        row, column = np.indices(self.values.shape) - self.shift[:, None, None]
        y, x = (inverse[n, 0] * row + inverse[n, 1] * column for n in (0, 1))
        return y, x

    def with_values(self, values: FloatGrid) -> "Lattice":
        """Return other values on the same lattice."""
        return Lattice(values=values, matrix=self.matrix, shift=self.shift)

    def at(self, y: FloatGrid, x: FloatGrid, *, order: int = SPLINE_ORDER) -> FloatGrid:
        """Return values at any pixels; missing ones are taken from their neighbours."""
        row, column = _lattice_places(self.matrix, self.shift, y, x)
        whole = filled(self.values)
        places = np.stack([row, column])
        values = ndimage.map_coordinates(whole, places, order=order, mode="mirror")  # type: ignore[call-overload]
        return np.asarray(values)


def filled(values: FloatGrid) -> FloatGrid:
    """Return values without NaN: each the median of its neighbours, 0 where all are missing."""
    missing = np.isnan(values)
    if not missing.any():
        return values
    row, column = np.nonzero(missing)
    wide = np.pad(values, 1, constant_values=np.nan)
    neighbours = np.stack([wide[row + dy, column + dx] for dy in range(3) for dx in range(3)])
    has_any = np.isfinite(neighbours).any(axis=0)
    result = values.copy()
    result[row, column] = 0.0
    result[row[has_any], column[has_any]] = np.nanmedian(neighbours[:, has_any], axis=0)
    return result


def _lattice_places(
    matrix: FloatGrid, shift: FloatGrid, y: NDArray[np.generic], x: NDArray[np.generic]
) -> tuple[FloatGrid, FloatGrid]:
    row, column = (
        np.asarray(matrix[n, 0] * y + matrix[n, 1] * x + shift[n], dtype=np.float64) for n in (0, 1)
    )
    return row, column
