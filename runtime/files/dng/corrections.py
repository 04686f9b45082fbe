"""Black of every pixel and gains over the field, applied to samples.

linear = (sample - black of its pixel) * gain of its pixel
-> stored again above one black of each cell or plane, so that all that follows is as for any file

Samples that are clipped in the file stay so: a gain below 1 makes no light of them, and one above 1
lifts nothing beyond white (DNG specification 1.7.1, chapter 5).
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern, cfa_channels
from camkit.runtime.capture import SATURATION_SHARE
from camkit.runtime.files.dng.dng_levels import BlackMap
from camkit.runtime.files.dng.opcodes import FieldGains
from camkit.runtime.files.raw_checks import Levels

BAND_ROWS: Final = 256
FULL: Final = 65535


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """Corrections that samples of a picture need before one black and one white hold for them.

    Attributes:
        black: Black of every pixel.
        gains: Gains over the field.
        whites: (plane,) white.
        cfa: Pattern at the first visible pixel; None for planes.
        offset: Row and column of the first visible pixel from the first active one.
    """

    black: BlackMap
    gains: FieldGains
    whites: FloatArray
    cfa: CfaPattern | None
    offset: tuple[int, int]

    def __bool__(self) -> bool:
        return bool(self.gains) or not self.black.is_of_cells or len(set(self.whites.tolist())) > 1

    def apply(self, samples: NDArray[Any]) -> tuple[NDArray[Any], Levels]:
        """Return corrected samples and their levels.

        Args:
            samples: (h, w) mosaic or (plane, h, w); whole numbers are stretched over 16 bits, so
                that rounding does not show.
        """
        cells, white = self.black.mean(mosaic=self.cfa is not None), float(self.whites.max())
        planes = samples[None] if self.cfa is not None else samples
        factor = 1
        if samples.dtype.kind != "f":
            factor = max(1, int(FULL // max(white, float(samples.max()))))
        out = np.empty(planes.shape, np.float32 if samples.dtype.kind == "f" else np.uint16)
        for plane in range(len(planes)):
            for top in range(0, planes.shape[1], BAND_ROWS):
                bottom = min(top + BAND_ROWS, planes.shape[1])
                band = self._band(planes[plane, top:bottom], top, plane, white, cells)
                if out.dtype == np.uint16:
                    band = np.clip(np.rint(band * factor), 0, FULL)
                out[plane, top:bottom] = band
        levels = Levels(black=cells * np.float32(factor), white=white * factor)
        return (out[0] if self.cfa is not None else out), levels

    def _band(
        self, stored: NDArray[Any], top: int, plane: int, white: float, cells: FloatArray
    ) -> NDArray[np.float64]:
        height, width = stored.shape
        light = stored - self.black.of_rows(top, top + height, plane)
        base = self._base(cells, top, plane, (height, width))
        span = white - base
        plane_white = float(self.whites[min(plane, len(self.whites) - 1)])
        light *= span / (plane_white - base)
        gain = self._gain(top, plane, (height, width))
        lifted = light * gain
        if stored.dtype.kind != "f":
            clipped = light >= SATURATION_SHARE * span
            lifted = np.where(clipped, light, np.minimum(lifted, span))
        return np.asarray(lifted + base)

    def _base(
        self, cells: FloatArray, top: int, plane: int, shape: tuple[int, int]
    ) -> NDArray[np.float64]:
        """Return the black that the band is stored above: (h, w), or one number of a plane."""
        if cells.ndim == 1:
            return np.float64(cells[plane]) * np.ones((1, 1))
        down, across = np.arange(top, top + shape[0]) % 2, np.arange(shape[1]) % 2
        return cells.astype(np.float64)[np.ix_(down, across)]

    def _gain(self, top: int, plane: int, shape: tuple[int, int]) -> NDArray[np.float32]:
        gain = np.ones(shape, dtype=np.float32)
        rows = np.arange(top, top + shape[0]) + self.offset[0]
        cols = np.arange(shape[1]) + self.offset[1]
        for one in self.gains.mosaic:
            gain *= one.at(rows, cols, plane)
        if self.cfa is None:
            for one in self.gains.colours:
                gain *= one.at(rows, cols, plane)
            return gain
        cell = np.array(cfa_channels(self.cfa))
        for dy, dx in np.ndindex(2, 2):
            part = np.s_[(dy - top) % 2 :: 2, dx::2]
            for one in self.gains.colours:
                gain[part] *= one.at(rows[part[0]], cols[part[1]], int(cell[dy, dx]))
        return gain
