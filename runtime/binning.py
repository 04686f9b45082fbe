"""Averages of a mosaic over squares: their weights, what becomes of noise and detail.

    place of a colour's samples in a square -> weights that move their mean to the middle
                                            -> variance of the mean, and its transfer

A sample of the smaller planes stands for the mean of the light over its square: the picture that
the full one shows when it is averaged. What averaging does to a colour is relative to that.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern, cfa_channels
from camkit.errors import ContractError

CELL_PX: Final = 2
"""Side of the cell of a mosaic."""
COLOURS: Final = 3
FloatGrid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Binning:
    """The squares of a mosaic over which every colour is averaged.

    Attributes:
        side_px: Side of a square.
        cfa: Of the mosaic.
    """

    side_px: int
    cfa: CfaPattern

    def __post_init__(self) -> None:
        if self.side_px < CELL_PX or self.side_px % CELL_PX:
            raise ContractError(f"squares have whole cells of a mosaic; got {self.side_px} px")

    def sites(self, colour: int) -> list[tuple[int, int]]:
        """Return (row, column) of the samples of a colour in a square."""
        cell = np.tile(np.array(cfa_channels(self.cfa)), (self.side_px // CELL_PX,) * 2)
        return [(int(y), int(x)) for y, x in np.argwhere(cell == colour)]

    def shift_px(self, colour: int) -> tuple[float, float]:
        """Return (down, across) from the mean place of a colour's samples to the middle, in px."""
        down, across = (self.side_px - 1) / 2 - np.mean(self.sites(colour), axis=0)
        return float(down), float(across)

    def shift_weights(self, colour: int) -> tuple[FloatArray, FloatArray]:
        """Return (down, across): weights of means -1..1 that move a colour to the middle.

        They are linear: what lies between two samples is nowhere outside their range.
        """
        down, across = (_hat(to / self.side_px) for to in self.shift_px(colour))
        return down, across

    @property
    def noise_factors(self) -> tuple[float, ...]:
        """Return the variance of a mean of every colour over that of a sample."""
        return tuple(
            float(np.prod([np.square(w).sum() for w in self.shift_weights(colour)]))
            / len(self.sites(colour))
            for colour in range(COLOURS)
        )

    def transfer(self, colour: int, frequencies: FloatGrid) -> FloatGrid:
        """Return what averaging does to a colour along an axis, over what it does to the picture.

        Means over all pixels of a square are the picture's; those of one colour have fewer, and
        are moved. Green, which lies across the cell, is taken as if it filled it.

        Args:
            colour: Its index.
            frequencies: (n,) in cycles per pixel before averaging.
        """
        places = np.arange(self.side_px) - (self.side_px - 1) / 2
        own = places[sorted({row for row, _ in self.sites(colour)})]
        means = waves(own, frequencies).mean(axis=1)
        moved = waves(np.arange(-1, 2) * self.side_px, frequencies)
        moved = moved @ self.shift_weights(colour)[0]
        share = np.abs(means * moved) / np.abs(waves(places, frequencies).mean(axis=1))
        return np.asarray(share, np.float64)


def waves(places_px: NDArray[Any], frequencies: FloatGrid) -> NDArray[np.complex128]:
    """Return (frequency, place): the phases at some places."""
    return np.asarray(np.exp(2j * np.pi * np.outer(frequencies, places_px)), np.complex128)


def _hat(to: float) -> FloatArray:
    """Return (3,): weights of samples -1, 0, 1 for the signal at a place -1..1, linear."""
    return np.asarray(np.maximum(1 - np.abs(np.arange(-1, 2) - to), 0), np.float32)
