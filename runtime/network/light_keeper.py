"""The step behind a network, window by window: its light bounded, its change weakened.

    network -> output of a window -> LightKeeper -> pixels that are kept

It also counts in how many cells the network's own local mean left the usual bound.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.light_bound import CELL_PX, USUAL_BOUND, LightBound
from camkit.runtime.network.light_bound import AddedLight, added_light, keep_bright, take_back
from camkit.runtime.network.white_keeper import WhiteKeeper

LOOK_ROWS: Final = 32
LOOK_EVERY: Final = 4
"""One in so many strips of rows is looked at where nothing is taken back."""

Box = tuple[int, int, int, int]
"""(top, left, bottom, right) of the pixels of a window that are kept."""
WindowFinish = Callable[[FloatArray, FloatArray, Box], None]
"""Changes the (c, h, w) output of a window in place; gets what the network was given, masks too."""


@dataclass(slots=True, kw_only=True)
class LightKeeper:
    """Bounds the light of one picture's network; serves one thread.

    Attributes:
        front: Channels of what is given that the network improves on.
        kept_channel: Channel that says how much is kept beside clipped samples; None for all.
        bound: What is taken back; None where the light is only measured.
        measured: Whether the light is measured; without it and a bound only `strength` counts.
        strength: How much of what the network adds is kept, 0..1.
        bright: (c,) stabilised: what reaches it in every channel is not darkened; None for any.
        white: Keeps lamps from ending darker than what is given, or than white; None for any.
        scale: Divisor of the stabilising transform.
        cells: Cells seen so far.
        unexplained: Of these, cells whose local mean left the usual bound.
        large: Of these, cells in which much light was moved.
    """

    front: slice
    kept_channel: int | None
    bound: LightBound | None
    measured: bool
    strength: float
    scale: float
    bright: FloatArray | None = None
    white: WhiteKeeper | None = None
    cells: int = 0
    unexplained: int = 0
    large: int = 0

    def __call__(self, output: FloatArray, inputs: FloatArray, box: Box) -> None:
        """Change the output of a window.

        Args:
            output: (c, h, w) float32, stabilised.
            inputs: (channels, h, w) float32: inputs of the network, and what is kept.
            box: Pixels that the window keeps.
        """
        front = inputs[self.front]
        share = None if self.kept_channel is None else inputs[self.kept_channel]
        if share is not None and float(share.min()) == 1:
            share = None
        excess = None
        if self.bound is not None:
            added = self._added(front, output, share, self.bound)
            self._count(added, box)
            excess = added.excess
        elif self.measured:
            self._measure(front, output)
        if excess is not None or share is not None or self.strength != 1:
            take_back(front, output, share, excess, strength=self.strength)
        if self.bright is not None:
            keep_bright(front, output, self.bright, scale=self.scale)
        if self.white is not None:
            self.white.keep(output, front)

    @property
    def fallback_fraction(self) -> float:
        """Return the share of cells whose local mean left the usual bound."""
        return self.unexplained / max(self.cells, 1)

    @property
    def large_fraction(self) -> float:
        """Return the share of cells in which much light was moved."""
        return self.large / max(self.cells, 1)

    def _measure(self, front: FloatArray, output: FloatArray) -> None:
        """Measure some rows of an output that stays as it is: where it matters it is everywhere."""
        height, width = (_floor(side) for side in output.shape[1:])
        for top in range(0, height, LOOK_EVERY * LOOK_ROWS):
            rows = np.s_[:, top : min(top + LOOK_ROWS, height), :width]
            crop = output[rows].copy()
            if crop.size:
                added = self._added(front[rows], crop, None, USUAL_BOUND)
                self._count(added, (0, 0, *crop.shape[1:]))

    def _added(
        self, front: FloatArray, output: FloatArray, share: FloatArray | None, bound: LightBound
    ) -> AddedLight:
        return added_light(front, output, share, bound, scale=self.scale)

    def _count(self, added: AddedLight, box: Box) -> None:
        top, left, bottom, right = box
        inside = np.s_[
            top // CELL_PX : -(-bottom // CELL_PX), left // CELL_PX : -(-right // CELL_PX)
        ]
        self.cells += added.unexplained[inside].size
        self.unexplained += int(np.count_nonzero(added.unexplained[inside]))
        self.large += int(np.count_nonzero(added.large[inside]))


def _floor(side_px: int) -> int:
    """Return the whole cells of a side, in pixels."""
    return side_px // CELL_PX * CELL_PX
