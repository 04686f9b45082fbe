"""A picture sheared so that its streaks stand upright, a few rows in one, and back.

Column c of the slant is the line x = c + shift(y) of the picture, shift(y) = y tan(angle) less what
keeps it >= 0 for every x: along it a streak of that angle stays in one column.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError

MOST_RAD = math.radians(45)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slant:
    """The map of a picture's samples to a slanted grid.

    Attributes:
        angle_rad: Of the streaks from the vertical; > 0 where they lean right going down.
        height: Rows of the picture.
        width: Its columns.
        step: Rows of the picture in one of the slant; a last part of so many is left out.
    """

    angle_rad: float
    height: int
    width: int
    step: int = 1

    def __post_init__(self) -> None:
        """Refuse what cannot be sheared.

        Raises:
            ContractError: If the angle is too flat, or there is no whole row.
        """
        if not abs(self.angle_rad) <= MOST_RAD:
            raise ContractError(
                f"streaks lie within 45 degrees of the vertical; "
                f"got {math.degrees(self.angle_rad):g}"
            )
        if not 1 <= self.step <= self.height or self.width < 1:
            raise ContractError(
                f"a slant needs a row of {self.step} px; got {self.height}x{self.width}"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """Return (rows, columns)."""
        return self.height // self.step, self.width + math.ceil(self._span) + 1

    @property
    def _span(self) -> float:
        return abs(math.tan(self.angle_rad)) * (self.height - 1)

    def shift_px(self, row: float) -> float:
        """Return the place in a row of the picture of the first column of the slant, <= 0."""
        slope = math.tan(self.angle_rad)
        return row * slope - max(slope, 0.0) * (self.height - 1)

    def gathered(
        self, read: Callable[[int, int], FloatArray], channels: int, rows_at_once: int = 256
    ) -> tuple[FloatArray, FloatArray]:
        """Return a picture in the slant, each of its rows the mean of `step` rows.

        Args:
            read: Gives rows top..bottom of the picture, (channels, rows, width) float32.
            channels: Of the picture.
            rows_at_once: Rows to read at once, at least; no sum depends on it.

        Returns:
            (channels, *shape) float32, 0 where the picture is not; and the share of the rows that
            lie in the picture, of that shape.
        """
        count, columns = self.shape
        slanted = np.zeros((channels, count, columns), np.float32)
        share = np.zeros((count, columns), np.float32)
        at_once = max(rows_at_once // self.step, 1)
        for first in range(0, count, at_once):
            last = min(first + at_once, count)
            band = read(first * self.step, last * self.step)
            for row in range(first, last):
                for y in range(row * self.step, (row + 1) * self.step):
                    line = band[:, y - first * self.step]
                    self._add(line, y, slanted[:, row], share[row])
        np.divide(slanted, share, out=slanted, where=share > 0)
        share /= self.step
        return slanted, share

    def _add(self, line: FloatArray, y: int, target: FloatArray, share: FloatArray) -> None:
        """Add a row of the picture, linear between its samples, where it has two."""
        shift = self.shift_px(y)
        whole = math.floor(shift)
        rest = np.float32(shift - whole)
        inside = slice(-whole, -whole + self.width - 1)
        target[:, inside] += (1 - rest) * line[:, :-1] + rest * line[:, 1:]
        share[inside] += 1

    def resampled(self, field: FloatArray, top: int, rows: int) -> FloatArray:
        """Interpolate a field of the slant over rows of the picture, linear between its samples.

        Args:
            field: (..., *shape).
            top: First row of the picture.
            rows: Of the picture.

        Returns:
            (..., rows, width) float32; every pixel follows from its own place alone.
        """
        out = np.empty((*field.shape[:-2], rows, self.width), np.float32)
        last = field.shape[-2] - 1
        for number in range(rows):
            y = top + number
            place = min(max((y - (self.step - 1) / 2) / self.step, 0.0), float(last))
            low = int(place)
            high, rest = min(low + 1, last), np.float32(place - low)
            line = field[..., low, :] * (1 - rest) + field[..., high, :] * rest
            shift = -self.shift_px(y)
            whole = math.floor(shift)
            part = np.float32(shift - whole)
            left = line[..., whole : whole + self.width]
            right = line[..., whole + 1 : whole + 1 + self.width]
            out[..., number, :] = left * (1 - part) + right * part
        return out
