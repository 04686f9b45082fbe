"""Gains over the field that opcodes of a DNG ask for: lens shading undone.

GainMap (opcode 9) is bilinear between the points of a grid and clamped beyond them; pixel centres
lie at half numbers of the active area, whose height and width are 1. FixVignetteRadial (opcode 3)
is an even polynomial of the distance from the centre, 1 at the farthest corner. DNG specification
1.7.1, chapter 7.
"""

import struct
from dataclasses import dataclass
from typing import ClassVar, Final, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from camkit.errors import DecodeError

Places = NDArray[np.int64]
Gains = NDArray[np.float32]

MOST_GAIN: Final = 1e4
_MAP_HEAD: Final = struct.Struct(">10I4dI")
_RADIAL: Final = struct.Struct(">7d")


class FieldGain(Protocol):
    """A gain for every pixel of the active area."""

    name: ClassVar[str]

    @property
    def most(self) -> float:
        """Return the largest gain."""
        ...

    def at(self, rows: Places, cols: Places, plane: int) -> Gains:
        """Return (row, col) gains of a plane at rows and columns of the active area."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GainMap:
    """One GainMap.

    Attributes:
        gains: (v, h, plane) points of the grid.
        area: Top, left, bottom, right of what it changes, from the first active pixel on.
        planes: First plane that it changes, and how many.
        pitch: Every how many rows and columns.
        spacing: Of the points, down and across, in heights and widths of the active area.
        origin: Of the first point.
        size: (h, w) of the active area.
    """

    gains: Gains
    area: tuple[int, int, int, int]
    planes: tuple[int, int]
    pitch: tuple[int, int]
    spacing: tuple[float, float]
    origin: tuple[float, float]
    size: tuple[int, int]

    name: ClassVar[str] = "GainMap"

    @classmethod
    def of_opcode(cls, data: bytes, size: tuple[int, int]) -> Self:
        """Read the data of opcode 9.

        Raises:
            DecodeError: If it is cut off or its numbers cannot be.
        """
        if len(data) < _MAP_HEAD.size:
            raise DecodeError("its GainMap is cut off")
        *whole, step_v, step_h, first_v, first_h, planes = _MAP_HEAD.unpack_from(data)
        top, left, bottom, right, plane, count, row_pitch, col_pitch, v, h = whole
        if len(data) != _MAP_HEAD.size + 4 * v * h * planes or not v * h * planes:
            raise DecodeError(f"its GainMap of {v}x{h}x{planes} points has {len(data)} bytes")
        gains = np.frombuffer(data, ">f4", offset=_MAP_HEAD.size).reshape(v, h, planes)
        place = (step_v, step_h, first_v, first_h)
        sound = np.isfinite(gains).all() and gains.min() >= 0 and gains.max() <= MOST_GAIN
        if not (sound and np.isfinite(place).all() and min(step_v, step_h) >= 0):
            raise DecodeError("its GainMap holds what is no gain")
        if min(row_pitch, col_pitch) < 1 or not (top <= bottom and left <= right):
            raise DecodeError("its GainMap covers nothing")
        return cls(
            gains=gains.astype(np.float32),
            area=(top, left, bottom, right),
            planes=(plane, count),
            pitch=(row_pitch, col_pitch),
            spacing=(step_v, step_h),
            origin=(first_v, first_h),
            size=size,
        )

    @property
    def most(self) -> float:
        """Return the largest gain."""
        return float(self.gains.max())

    def at(self, rows: Places, cols: Places, plane: int) -> Gains:
        """Return (row, col) gains of a plane; 1 where the map changes nothing."""
        gains = np.ones((rows.size, cols.size), dtype=np.float32)
        first, count = self.planes
        if not first <= plane < first + count:
            return gains
        top, left, bottom, right = self.area
        down = (rows >= top) & (rows < bottom) & ((rows - top) % self.pitch[0] == 0)
        across = (cols >= left) & (cols < right) & ((cols - left) % self.pitch[1] == 0)
        grid = self.gains[..., min(plane, self.gains.shape[2] - 1)]
        by_row = _interpolate(grid, self._points(rows[down], 0))
        gains[np.ix_(down, across)] = _interpolate(by_row.T, self._points(cols[across], 1)).T
        return gains

    def _points(self, places: Places, axis: int) -> NDArray[np.float64]:
        """Return the positions of pixels between the points of the grid."""
        last, step = self.gains.shape[axis] - 1, self.spacing[axis]
        if not last or not step:
            return np.zeros(places.size)
        where = ((places + 0.5) / self.size[axis] - self.origin[axis]) / step
        return np.clip(where, 0, last)


def _interpolate(grid: Gains, points: NDArray[np.float64]) -> Gains:
    """Return (point, n) rows between the rows of a grid (v, n)."""
    lower = np.minimum(points.astype(np.int64), len(grid) - 1)
    upper = np.minimum(lower + 1, len(grid) - 1)
    part = (points - lower).astype(np.float32)[:, None]
    return np.asarray(grid[lower] * (1 - part) + grid[upper] * part)


@dataclass(frozen=True, slots=True, kw_only=True)
class RadialGain:
    """One FixVignetteRadial.

    Attributes:
        terms: Factors of r^2, r^4 ... r^10.
        centre: (x, y) in widths and heights of the active area.
        size: (h, w) of the active area.
    """

    terms: tuple[float, ...]
    centre: tuple[float, float]
    size: tuple[int, int]

    name: ClassVar[str] = "FixVignetteRadial"

    @classmethod
    def of_opcode(cls, data: bytes, size: tuple[int, int]) -> Self:
        """Read the data of opcode 3.

        Raises:
            DecodeError: If it is cut off or gives gains that cannot be.
        """
        if len(data) != _RADIAL.size:
            raise DecodeError(f"its FixVignetteRadial has {len(data)} bytes")
        *terms, x, y = _RADIAL.unpack(data)
        if not (np.isfinite(terms).all() and 0 <= x <= 1 and 0 <= y <= 1):
            raise DecodeError("its FixVignetteRadial holds what is no gain")
        gain = cls(terms=tuple(terms), centre=(x, y), size=size)
        gains = gain._of_squares(np.linspace(0, 1, 65))
        if gains.min() < 0 or gains.max() > MOST_GAIN:
            raise DecodeError("its FixVignetteRadial holds what is no gain")
        return gain

    @property
    def most(self) -> float:
        """Return the largest gain."""
        return float(self._of_squares(np.linspace(0, 1, 65)).max())

    def at(self, rows: Places, cols: Places, plane: int) -> Gains:  # noqa: ARG002 - alike for all
        """Return (row, col) gains, alike for every plane."""
        (height, width), (x, y) = self.size, (self.centre[0], self.centre[1])
        down, across = rows + 0.5 - y * height, cols + 0.5 - x * width
        corner_square = (max(x, 1 - x) * width) ** 2 + (max(y, 1 - y) * height) ** 2
        squares = (down[:, None] ** 2 + across**2) / corner_square
        return self._of_squares(squares).astype(np.float32)

    def _of_squares(self, squares: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(1 + squares * np.polyval(self.terms[::-1], squares))
