"""Kernels as sums of round blobs, and how light rises across an edge behind each of them.

Blobs lie densely in the middle of a kernel and thinly towards its border. A kernel of a lens of
revolution is symmetric about the direction away from the axis, so a blob beside that direction has
a mirror image of the same weight.

    u  away from the axis (down the rows of a frozen kernel),  v  to the side of it
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy import special

FloatLine = NDArray[np.float64]
FloatGrid = NDArray[np.float64]

LEVELS: Final = ((1.0, 4.0), (2.0, 10.0), (4.0, np.inf))
"""Spacing of blobs, and the distance from the middle to which they lie, in pixels."""
SPREAD: Final = 0.62
"""Standard deviation of a blob, in spacings."""
PIXEL_VARIANCE: Final = 1 / 12
"""Of the light of a sample, spread evenly over its pixel."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blobs:
    """Round blobs of light.

    Attributes:
        u_px: (k,) away from the axis.
        v_px: (k,) to the side, >= 0; each has its mirror image at -v.
        spread_px: (k,) standard deviations, the width of a pixel included.
        pairs: (m, 2) numbers of neighbours; a blob at the border has itself.
        stiffness: (m,) weight of the square of the difference of each pair.
    """

    u_px: FloatLine
    v_px: FloatLine
    spread_px: FloatLine
    pairs: NDArray[np.intp]
    stiffness: FloatLine

    @classmethod
    def of(cls, radius_px: float) -> Self:
        """Return the blobs of kernels that reach to some radius."""
        parts, pairs, stiffness, first = [], [], [], 0
        for spacing, end in LEVELS:
            steps = int(min(radius_px, end) / spacing)
            if steps < 1:
                continue
            places = {
                (i, j): None
                for i in range(-steps, steps + 1)
                for j in range(steps + 1)
                if np.hypot(i, j) * spacing <= min(radius_px, end)
            }
            number = {place: first + n for n, place in enumerate(places)}
            parts.append(
                np.array([(i * spacing, j * spacing, SPREAD * spacing) for i, j in places])
            )
            for i, j in places:
                for other in ((i + 1, j), (i, j + 1), (i - 1, j)):
                    if other in number and other < (i, j):
                        continue
                    pairs.append((number[i, j], number.get(other, number[i, j])))
                    stiffness.append(spacing**-4.0)
            first += len(places)
        table = np.concatenate(parts)
        return cls(
            u_px=table[:, 0],
            v_px=table[:, 1],
            spread_px=table[:, 2],
            pairs=np.array(pairs, dtype=np.intp),
            stiffness=np.array(stiffness),
        )

    @property
    def count(self) -> int:
        """Return the number of blobs."""
        return self.u_px.size

    def rises(self, distance_px: FloatLine, outward: float, sideways: float) -> FloatGrid:
        """Return (n, k): light across a sharp edge behind each blob, from 0 to 1.

        Args:
            distance_px: (n,) from the edge, > 0 where it is bright.
            outward: Component of the edge's unit normal away from the axis.
            sideways: The other component.
        """
        centre = self.u_px * outward
        side = self.v_px * sideways
        right = special.ndtr((distance_px[:, None] - (centre + side)) / self.spread_px)
        left = special.ndtr((distance_px[:, None] - (centre - side)) / self.spread_px)
        return np.asarray((right + left) / 2)

    def gaussian(self, spread_px: float) -> FloatLine:
        """Return weights (k,) that make about a round Gaussian, by the finest blobs that can."""
        variance = np.maximum(spread_px**2 - self.spread_px**2, 1e-3)
        radius = np.hypot(self.u_px, self.v_px)
        area = np.where(self.v_px > 0, 2, 1) * (self.spread_px / SPREAD) ** 2
        weights = area * np.exp(-(radius**2) / (2 * variance))
        return np.asarray(weights / weights.sum())

    def rings(self) -> FloatGrid:
        """Return (k, ring): weights of the blobs of round kernels, each of sum 1."""
        radius = np.hypot(self.u_px, self.v_px)
        columns = []
        for spread in np.unique(self.spread_px):
            level = self.spread_px == spread
            spacing = spread / SPREAD
            area = np.where(self.v_px > 0, 2.0, 1.0)
            for n in range(round(float(radius[level].max()) / spacing) + 1):
                hat = np.maximum(1 - np.abs(radius / spacing - n), 0) * area * level
                columns.append(hat / hat.sum())
        return np.stack(columns, axis=1)

    def kernels(self, weights: FloatGrid, half: int) -> FloatGrid:
        """Return (..., 2 half + 1, 2 half + 1) kernels of unit sum, u down the rows.

        Args:
            weights: (..., k) >= 0.
            half: Samples to each side of the middle.
        """
        offset = np.arange(-half, half + 1, dtype=np.float64)
        variance = self.spread_px**2 - PIXEL_VARIANCE
        rows = np.exp(-((offset - self.u_px[:, None]) ** 2) / (2 * variance[:, None]))
        columns = sum(
            np.exp(-((offset - sign * self.v_px[:, None]) ** 2) / (2 * variance[:, None])) / 2
            for sign in (-1, 1)
        )
        norm = 2 * np.pi * variance
        summed = np.einsum("...k,ky,kx->...yx", weights / norm, rows, columns)
        return np.asarray(summed / summed.sum(axis=(-2, -1), keepdims=True))
