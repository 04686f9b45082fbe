"""The front of the pipeline as rows: linearise, repair, white balance, demosaic."""

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.runtime.capture import Capture
from camkit.runtime.memory import release_pages
from camkit.runtime.signal.demosaic import (
    DEMOSAIC_MARGIN_PX,
    DemosaicMethod,
    apply_gains,
    demosaic,
    shift_rows,
)
from camkit.runtime.signal.noise import REPAIR_MARGIN_PX, repair_mosaic, repair_planes
from camkit.runtime.slices import run_slices

Places = tuple[NDArray[np.intp], ...]
"""Indices of samples as `np.nonzero` gives them: (plane,) row, column."""


class FrontRows:
    """White-balanced linear planes of a capture, made band by band, equal to the whole in bits.

    Attributes:
        repaired: Samples replaced in the rows read so far.
        clipped: Clipped samples in the rows read so far.
    """

    def __init__(
        self,
        capture: Capture,
        white_balance: tuple[float, float, float],
        *,
        method: DemosaicMethod,
        repair: bool,
        threads: int = 1,
    ) -> None:
        self._capture = capture
        self._threads = threads
        self._gains = white_balance
        self._method = method
        self._repair = repair
        self._counted = 0
        self._mended: list[Places] = []
        self.repaired = 0
        self.clipped = 0

    @property
    def shape(self) -> tuple[int, int, int]:
        """Give (3, h, w) of the capture."""
        return 3, self._capture.height, self._capture.width

    @property
    def clipped_fraction(self) -> float:
        """Give the share of clipped samples in the rows read so far."""
        samples = self._counted * self._capture.samples.size / self._capture.height
        return self.clipped / samples if samples else 0.0

    def read(self, top: int, bottom: int) -> FloatArray:
        """Give rows top..bottom as (3, bottom - top, w) float32, white-balanced."""
        planes = np.empty((3, bottom - top, self._capture.width), dtype=np.float32)
        found: list[tuple[int, int, Places]] = []

        def fill(first: int, last: int) -> None:
            found.append(self._fill(planes[:, first:last], top + first))

        run_slices(fill, bottom - top, threads=self._threads)
        release_pages(self._capture.samples)
        self._counted += bottom - top
        for clipped, repaired, mended in found:
            self.clipped += clipped
            self.repaired += repaired
            if mended[0].size:
                self._mended.append(mended)
        return planes

    def unknown_rows(self, top: int, bottom: int) -> NDArray[np.bool_]:
        """Tell which samples of rows top..bottom, read before, are clipped and were not repaired.

        A hot pixel is clipped as well, but its light is known from its neighbours.

        Returns:
            bool of the shape of the capture's `saturated_rows`.
        """
        unknown = self._capture.saturated_rows(top, bottom)
        for *plane, rows, columns in self._mended:
            inside = (rows >= top) & (rows < bottom)
            unknown[(*(p[inside] for p in plane), rows[inside] - top, columns[inside])] = False
        return unknown

    def _fill(self, planes: FloatArray, top: int) -> tuple[int, int, Places]:
        """Fill planes with the rows from `top` on.

        Returns:
            How many samples are clipped, how many were repaired, and which were both.
        """
        capture, bottom = self._capture, top + planes.shape[1]
        saturated = capture.saturated_rows(top, bottom)
        clipped = int(np.count_nonzero(saturated))
        margin = REPAIR_MARGIN_PX
        if capture.cfa is not None:
            margin += DEMOSAIC_MARGIN_PX[self._method]
        above, below = max(top - margin, 0), min(bottom + margin, capture.height)
        rows = capture.linear_rows(above, below)
        inside = slice(top - above, bottom - above)
        rows, mask = self._repaired(rows)
        mask = mask[..., inside, :]
        repaired = int(np.count_nonzero(mask))
        *plane, y, x = np.nonzero(mask & saturated)
        mended = (*plane, y + top, x)
        if capture.cfa is None:
            gains = np.array(self._gains, dtype=np.float32)[:, None, None]
            np.multiply(rows[:, inside], gains, out=planes)
            return clipped, repaired, mended
        cfa = shift_rows(capture.cfa, above)
        apply_gains(rows, cfa, self._gains)
        planes[:] = demosaic(rows, cfa, self._method)[:, inside]
        return clipped, repaired, mended

    def _repaired(self, rows: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        if not self._repair:
            return rows, np.zeros(rows.shape, dtype=bool)
        return repair_mosaic(rows) if self._capture.cfa is not None else repair_planes(rows)
