"""The pixels of an array: dark counts, hot and blind ones, beside their photons."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.job.stream import Stream
from camkit.runtime.rows import Rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Pixels:
    """Pixels of photons that are on their way through stages (`Stream.facts`).

    Attributes:
        dark: (h, w) dark counts of a bin that the photons hold.
        hot: (h, w) pixels that are known to count without light.
        blind: (h, w) pixels of rows read so far that pile-up left no counts in some bins.
        worst: (h,) of rows read so far, the largest share of cycles that a bin lost, or a gate
            used; 0 where unknown.
    """

    dark: NDArray[np.float64]
    hot: NDArray[np.bool_]
    blind: NDArray[np.bool_]
    worst: NDArray[np.float64]

    @classmethod
    def unknown(
        cls,
        shape: tuple[int, int],
        *,
        hot: NDArray[np.bool_] | None = None,
        dark: NDArray[np.float64] | None = None,
    ) -> Self:
        """Return pixels (h, w) of which nothing else is known; without dark counts unless given."""
        return cls(
            dark=np.zeros(shape) if dark is None else dark,
            hot=np.zeros(shape, dtype=bool) if hot is None else hot,
            blind=np.zeros(shape, dtype=bool),
            worst=np.zeros(shape[0]),
        )

    @classmethod
    def of(cls, photons: Stream) -> Self:
        """Return the pixels of photons; those that no stage corrected are not known."""
        pixels = photons.facts
        return pixels if isinstance(pixels, cls) else cls.unknown(photons.shape[1:])


def by_pixel(rows: Rows) -> FloatArray:
    """Return rows (t, rows, w) as (rows, w, t), the times of a pixel side by side in memory."""
    return np.ascontiguousarray(rows.transpose(1, 2, 0))
