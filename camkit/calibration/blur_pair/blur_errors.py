"""Errors of a predicted wide picture, in codes: by block of the picture, by zone and by colour.

For every prediction alike a gain of each colour and its fall with r^2 are fitted, those of the
even blocks on the odd ones and the reverse, so that no pixel is judged by a gain it helped to fit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.sensor import RGB
from camkit.calibration.blur_pair.pair_grid import PairGrid
from camkit.calibration.blur_pair.picture_pair import Mask, PicturePair

FloatGrid = NDArray[np.float64]

CENTRE: Final = 0.3
CORNER: Final = 0.7
"""Of half the diagonal."""
ZONES: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlurErrors:
    """Squared errors of codes, white at 1.

    Attributes:
        sums: (block, zone, colour); zones are centre, between, corner.
        counts: Likewise, samples.
    """

    sums: FloatGrid
    counts: FloatGrid

    @classmethod
    def joined(cls, parts: Sequence["BlurErrors"]) -> "BlurErrors":
        """Return the errors of several pairs of pictures as one."""
        return cls(
            sums=np.concatenate([part.sums for part in parts]),
            counts=np.concatenate([part.counts for part in parts]),
        )

    def psnr_db(self, zone: int | None = None, colour: int | None = None) -> float:
        """Return the PSNR, white at 1; NaN where nothing counts."""
        at = np.s_[
            :, slice(None) if zone is None else zone, slice(None) if colour is None else colour
        ]
        total, count = self.sums[at].sum(), self.counts[at].sum()
        return float(-10 * np.log10(total / count)) if count else float("nan")

    def to_record(self) -> dict[str, Any]:
        """Return decibels over all, by colour, at the centre and in the corners."""
        rounded = {
            "psnr_db": self.psnr_db(),
            "centre_db": self.psnr_db(zone=0),
            "corner_db": self.psnr_db(zone=ZONES - 1),
        }
        record: dict[str, Any] = {
            name: None if np.isnan(value) else round(value, 3) for name, value in rounded.items()
        }
        record["colours_db"] = [round(self.psnr_db(colour=c), 3) for c in range(len(RGB))]
        return record


def gain_db(better: BlurErrors, other: BlurErrors) -> tuple[float, float]:
    """Return by how many dB one prediction is better than another, and its standard error.

    References: the jackknife over blocks of Efron 1982.
    """
    ours, theirs = better.sums.sum((1, 2)), other.sums.sum((1, 2))
    blocks = np.flatnonzero(better.counts.sum((1, 2)))
    ours, theirs = ours[blocks], theirs[blocks]
    left_out_db = 10 * np.log10((theirs.sum() - theirs) / (ours.sum() - ours))
    n = len(blocks)
    error = float(np.sqrt((n - 1) / n * np.square(left_out_db - left_out_db.mean()).sum()))
    return float(10 * np.log10(theirs.sum() / ours.sum())), error


class Judge:
    """The pictures of a pair, ready to judge predictions."""

    def __init__(self, pair: PicturePair, grid: PairGrid, counts: Mask) -> None:
        """Compute what is the same for all predictions.

        Args:
            pair: The pictures.
            grid: Blocks.
            counts: (h, w), what counts.
        """
        self.pair, self.grid, self.counted = pair, grid, counts
        height, width = pair.size
        y = np.arange(height)[:, None] - (height - 1) / 2
        x = np.arange(width)[None] - (width - 1) / 2
        self._radius = (np.hypot(y, x) / (np.hypot(height, width) / 2)).astype(np.float32)
        zones = 1 - (self._radius < CENTRE).astype(np.intp) + (self._radius > CORNER)
        blocks = grid.blocks()
        self._cell = grid.indices() * ZONES + zones
        self._cells = len(blocks) * ZONES
        self._is_even = np.array([b.is_even for b in blocks])[grid.indices()]
        self._wide_codes = pair.codes_of(pair.wide)
        self._slopes = pair.code_slopes(pair.wide)

    def errors(self, blurred: FloatArray) -> BlurErrors:
        """Return the errors of a prediction.

        Args:
            blurred: (3, h, w) light of the sharp picture, blurred.
        """
        sums, counts = (np.zeros((self._cells, len(RGB))) for _ in range(2))
        cell = self._cell[self.counted]
        missed = self.pair.codes_of(self.scaled(blurred)) - self._wide_codes
        for c in range(len(RGB)):
            squares = np.square(missed[c][self.counted].astype(np.float64))
            sums[:, c] = np.bincount(cell, squares, minlength=self._cells)
            counts[:, c] = np.bincount(cell, minlength=self._cells)
        shape = (-1, ZONES, len(RGB))
        return BlurErrors(sums=sums.reshape(shape), counts=counts.reshape(shape))

    def scaled(self, blurred: FloatArray) -> FloatArray:
        """Return a prediction as bright as the wide picture, by the gains it is judged with.

        Args:
            blurred: (3, h, w) light.
        """
        scaled = np.empty_like(blurred)
        for c in range(len(RGB)):
            for judged in (self._is_even, ~self._is_even):
                scaled[c][judged] = self._scaled(blurred[c], c, self.counted & ~judged)[judged]
        return scaled

    def _scaled(self, blurred: FloatArray, c: int, fitted: Mask) -> FloatArray:
        """Return a colour with the gain and fall-off that fit best where told, in codes."""
        slope = self._slopes[c][fitted].astype(np.float64)
        light = blurred[fitted].astype(np.float64) * slope
        squared = np.square(self._radius)
        columns = np.stack([light, light * squared[fitted]])
        target = self.pair.wide[c][fitted] * slope
        gain, fall = np.linalg.lstsq(columns @ columns.T, columns @ target, rcond=None)[0]
        return np.asarray(blurred * (gain + fall * squared), dtype=np.float32)
