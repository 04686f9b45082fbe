"""The front of the pipeline as rows: linearise, repair, white balance, demosaic."""

import numpy as np

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
        counts: list[tuple[int, int]] = []

        def fill(first: int, last: int) -> None:
            found = self._fill(planes[:, first:last], top + first)
            counts.append(found)

        run_slices(fill, bottom - top, threads=self._threads)
        release_pages(self._capture.samples)
        self._counted += bottom - top
        self.clipped += sum(clipped for clipped, _ in counts)
        self.repaired += sum(repaired for _, repaired in counts)
        return planes

    def _fill(self, planes: FloatArray, top: int) -> tuple[int, int]:
        """Fill planes with the rows from `top` on; count clipped and repaired samples."""
        capture, bottom = self._capture, top + planes.shape[1]
        clipped = int(np.count_nonzero(capture.saturated_rows(top, bottom)))
        margin = REPAIR_MARGIN_PX
        if capture.cfa is not None:
            margin += DEMOSAIC_MARGIN_PX[self._method]
        above, below = max(top - margin, 0), min(bottom + margin, capture.height)
        rows = capture.linear_rows(above, below)
        inside = slice(top - above, bottom - above)
        rows, repaired = self._repaired(rows, inside)
        if capture.cfa is None:
            gains = np.array(self._gains, dtype=np.float32)[:, None, None]
            np.multiply(rows[:, inside], gains, out=planes)
            return clipped, repaired
        cfa = shift_rows(capture.cfa, above)
        apply_gains(rows, cfa, self._gains)
        planes[:] = demosaic(rows, cfa, self._method)[:, inside]
        return clipped, repaired

    def _repaired(self, rows: FloatArray, inside: slice) -> tuple[FloatArray, int]:
        if not self._repair:
            return rows, 0
        repair = repair_mosaic if self._capture.cfa is not None else repair_planes
        rows, mask = repair(rows)
        return rows, int(np.count_nonzero(mask[..., inside, :]))
