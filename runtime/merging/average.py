"""The weighted mean over frames, one frame after the other, from the longest to the shortest.

Two numbers per sample are held whatever the number of frames. A clipped sample says "at least this
much" and is never averaged; a pixel that no frame holds unclipped takes the value of the shortest
frame that clips there, one that is black in every frame that of the longest.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Exposed:
    """The samples of one frame in some rows.

    Attributes:
        value: (channel, rows, w) float32, in what is averaged: light, or its logarithm.
        precision: One over the variance of `value`; its scale is that of all frames.
        usable: Neither clipped nor black nor broken.
        clipped: At least this bright.
    """

    value: FloatArray
    precision: FloatArray
    usable: BoolArray
    clipped: BoolArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Average:
    """The mean so far; its arrays are filled in place.

    Attributes:
        value: (channel, h, w) float32, in what is averaged.
        precision: One over the variance of `value`; 0 where no frame was usable.
    """

    value: FloatArray
    precision: FloatArray

    @classmethod
    def empty(cls, shape: tuple[int, int, int]) -> Self:
        """Return an average of nothing."""
        return cls(
            value=np.full(shape, np.nan, dtype=np.float32),
            precision=np.zeros(shape, dtype=np.float32),
        )

    def add(self, top: int, bottom: int, exposed: Exposed) -> None:
        """Add rows top..bottom of the next shorter frame."""
        value, precision = self.value[:, top:bottom], self.precision[:, top:bottom]
        settled = precision > 0
        first = exposed.usable & ~settled
        bound = ~settled & (exposed.clipped | np.isnan(value)) & ~np.isnan(exposed.value)
        np.copyto(value, exposed.value, where=first | bound)
        np.copyto(precision, exposed.precision, where=first)
        repeated = exposed.usable & settled
        total = precision[repeated] + exposed.precision[repeated]
        value[repeated] += (
            exposed.precision[repeated] / total * (exposed.value[repeated] - value[repeated])
        )
        precision[repeated] = total
