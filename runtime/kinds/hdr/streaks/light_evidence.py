"""The evidence for each light: how much of the picture it explains; without any it stays as seen.

    lights of cells -> places -> cost of the picture without each, less that with it, of all colours
                    -> share of its excess over white that stands

The cost is that of the descent, summed over the gradients about a place: one that a streak explains
wholly counts 1, and texture that looks like a streak may count a few. Where the evidence is faint,
most lights are found far too bright: texture that lies along their arms has no other explanation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.convolution import spreading
from camkit.runtime.kinds.hdr.streaks.descent import gradient, usable_cells
from camkit.runtime.kinds.hdr.streaks.shapes import repeated

SCALE: Final = 0.006
"""Of the cost: the last and narrowest of the descent."""
NOTHING: Final = 8.0
"""Evidence that proves nothing."""
ENOUGH: Final = 32.0
"""Evidence with which a light stands as it was found."""
WHITE: Final = 1.0
"""Where samples clip; no light is less."""
_EIGHT: Final = np.ones((3, 3), np.int8)
Mask = NDArray[np.bool_]
Box = tuple[slice, slice]


class Judge:
    """Tells what a window of one colour would cost more without a light."""

    def __init__(self, light: FloatArray, rest: FloatArray, kernel: FloatArray) -> None:
        """Store the recovery of a window.

        Args:
            light: (h, w) float32, 0 outside the clipped cells.
            rest: (h, w) float32: what is seen, less what known light and this have thrown there.
            kernel: (n, n) float32, n odd: what a cell's light becomes.
        """
        self._rest = rest
        self._usable = usable_cells(light > 0)
        self._kernel = kernel

    def evidence(self, excess: FloatArray, box: Box) -> float:
        """Return cost of the picture without an excess that lies in a box, less that with it."""
        outer, inner = self._boxes(box)
        rest, usable = self._rest[outer], self._usable[outer]
        light = np.zeros(rest.shape, np.float32)
        light[inner] = excess
        streaks = spreading(self._kernel, light > 0).spread(light)
        return _cost(rest + streaks, usable) - _cost(rest, usable)

    def _boxes(self, box: Box) -> tuple[Box, Box]:
        """Return the place that the streaks of a box reach, and the box within it."""
        reach = self._kernel.shape[0] // 2
        (top, bottom), (left, right) = (
            (max(side.start - reach, 0), min(side.stop + reach, end))
            for side, end in zip(box, self._rest.shape, strict=True)
        )
        inner = (
            slice(box[0].start - top, box[0].stop - top),
            slice(box[1].start - left, box[1].stop - left),
        )
        return (slice(top, bottom), slice(left, right)), inner


@dataclass(frozen=True, slots=True, kw_only=True)
class Proven:
    """Lights of which as much is left as the picture proves.

    Attributes:
        share: (h, w) float32: share of its excess over white that a light keeps, of all colours.
        given_up: Places that were found brighter than white and are left as they were seen.
    """

    share: FloatArray
    given_up: int

    def part_of(self, light: FloatArray) -> FloatArray:
        """Return the proven part of light (..., h, w)."""
        excess = np.maximum(light - np.float32(WHITE), 0)
        return np.asarray(light - (1 - self.share) * excess, np.float32)

    def finer(self, shape: tuple[int, int]) -> "Proven":
        """Return the same in cells of half the pitch; a last odd one goes with its neighbour."""
        return replace(self, share=repeated(self.share, shape))


def proven(light: FloatArray, judges: Sequence[Judge | None]) -> Proven:
    """Return the evidence of the picture for lights.

    A light mostly has all colours: what is proven in one speaks for the others.

    Args:
        light: (3, h, w) float32, 0 outside the clipped cells; 1.0 = where samples clip.
        judges: For every colour that clipped.
    """
    labels, _ = scipy.ndimage.label((light > 0).any(axis=0), structure=_EIGHT)
    shares, given_up = np.ones(labels.shape, np.float32), 0
    for number, (rows, columns) in enumerate(scipy.ndimage.find_objects(labels), 1):
        box = rows, columns
        excess = np.where(labels[box] == number, np.maximum(light[:, *box] - WHITE, 0), 0)
        evidence = [
            judge.evidence(part, box)
            for part, judge in zip(excess, judges, strict=True)
            if judge is not None and part.any()
        ]
        if evidence:
            share = share_of(sum(evidence))
            shares[box][labels[box] == number] = share
            given_up += share == 0
    return Proven(share=shares, given_up=given_up)


def share_of(evidence: float) -> float:
    """Return the share of its excess that a light keeps."""
    return min(max((evidence - NOTHING) / (ENOUGH - NOTHING), 0.0), 1.0)


def _cost(rest: FloatArray, usable: Mask) -> float:
    """Return the cost of the gradients between cells that tell."""
    down, across = usable[1:] & usable[:-1], usable[:, 1:] & usable[:, :-1]
    whole = 0.0
    for slope, there in zip(gradient(rest), (down, across), strict=True):
        squared = np.square(slope / np.float32(SCALE))
        whole += float(np.sum(squared / (1 + squared), where=there, dtype=np.float64))
    return whole
