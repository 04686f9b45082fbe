"""The front of the pipeline as rows: linearise, repair, white balance, demosaic."""

import numpy as np

from camkit.contracts import FloatArray
from camkit.runtime.capture import Capture
from camkit.runtime.signal.demosaic import (
    DEMOSAIC_MARGIN_PX,
    DemosaicMethod,
    apply_gains,
    demosaic,
    shift_rows,
)
from camkit.runtime.signal.noise import REPAIR_MARGIN_PX, repair_mosaic, repair_planes


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
    ) -> None:
        self._capture = capture
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
        capture = self._capture
        self.clipped += int(np.count_nonzero(capture.saturated_rows(top, bottom)))
        self._counted += bottom - top
        margin = REPAIR_MARGIN_PX
        if capture.cfa is not None:
            margin += DEMOSAIC_MARGIN_PX[self._method]
        above, below = max(top - margin, 0), min(bottom + margin, capture.height)
        rows = capture.linear_rows(above, below)
        inside = slice(top - above, bottom - above)
        rows = self._repaired(rows, inside)
        if capture.cfa is None:
            gains = np.array(self._gains, dtype=np.float32)[:, None, None]
            return rows[:, inside] * gains
        cfa = shift_rows(capture.cfa, above)
        apply_gains(rows, cfa, self._gains)
        return np.ascontiguousarray(demosaic(rows, cfa, self._method)[:, inside])

    def _repaired(self, rows: FloatArray, inside: slice) -> FloatArray:
        if not self._repair:
            return rows
        repair = repair_mosaic if self._capture.cfa is not None else repair_planes
        rows, mask = repair(rows)
        self.repaired += int(np.count_nonzero(mask[..., inside, :]))
        return rows
