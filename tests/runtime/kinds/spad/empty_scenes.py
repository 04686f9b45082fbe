"""Scenes of 64x32 pixels that are partly empty, counted with and without pile-up."""

from collections import Counter
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.kinds.spad.captures.known_pulse import LITTLE_LOST
from camkit.runtime.kinds.spad.pile_up import without_pile_up
from camkit.runtime.kinds.spad.pulse import GatedPulse
from camkit.runtime.kinds.spad.scatter import growth
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way
from camkit.runtime.kinds.spad.time_axis import Orientation, TimeAxis

HEIGHT, WIDTH, BINS = 32, 64, 125
RC_PS, SIGMA_PS = 60.0, 42.5
SURFACE_PS: Final = 1200.0
_Y, _X = np.mgrid[:HEIGHT, :WIDTH]
_ODD_Y, _ODD_X = _Y // 8 % 2 == 1, _X // 8 % 2 == 1
EMPTY: Final = {
    "squares of 8 px": ~(_ODD_Y & _ODD_X),
    "holes of 8 px": _ODD_Y & _ODD_X,
    "edge": _X < WIDTH // 2,
    "slanted edge": 2 * _Y + _X < WIDTH,
    "disc": np.hypot(_Y - HEIGHT // 2, _X - WIDTH // 2) > 11,
    "round hole": np.hypot(_Y - HEIGHT // 2, _X - WIDTH // 2) < 11,
    "gaps of 3 px": _X % 8 < 3,
    "sky": np.ones((HEIGHT, WIDTH), bool),
}
"""Name of a scene -> its empty pixels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """What surfaces and sky send.

    Attributes:
        photons: Signal of a pixel of a surface.
        ratio: Of these to the background of all bins.
        sky: Background of an empty pixel over that of a surface.
        lost: Photons of a cycle (histogram), or of a gate at its brightest; 0 for no pile-up.
    """

    photons: float
    ratio: float
    sky: float = 1.0
    lost: float = 0.0


class Stage:
    """Draws scenes and counts which pixels are believed."""

    def __init__(self, orientation: Orientation, width_ps: float, seed: int) -> None:
        self.axis = TimeAxis.regular(orientation, bins=BINS, time_bin_ps=20.0)
        self.pulse = GatedPulse(width_ps=width_ps, rc_ps=RC_PS, sigma_ps=SIGMA_PS)
        self._sharpener = Sharpener(self.axis, self.pulse, Way())
        self._rng = np.random.default_rng(seed)

    def believed(self, scene: str, light: Light) -> Counter[str]:
        """Return how many empty pixels and surface pixels there are and are believed."""
        empty, mean = EMPTY[scene], self._mean(EMPTY[scene], light)
        valid = self._valid(mean, self._cycles(light)) if light.lost else None
        if valid is None:
            counts = self._rng.poisson(mean).astype(np.float32)
            valid = self._sharpener.strip(counts).valid[0]
        return Counter(
            empty=int(empty.sum()),
            alarms=int((valid & empty).sum()),
            surface=int((~empty).sum()),
            seen=int((valid & ~empty).sum()),
        )

    def _mean(self, empty: NDArray[np.bool_], light: Light) -> NDArray[np.float64]:
        share = self.axis.shares(self.pulse, np.array([SURFACE_PS]), np.arange(BINS)[None])[0]
        even = light.photons / light.ratio / BINS
        return np.where(empty[..., None], light.sky * even, light.photons * share + even)

    def _cycles(self, light: Light) -> int:
        bright = self._mean(np.zeros((1, 1), bool), light)
        of_all = bright.sum() if self.axis.orientation == "histogram" else bright.max()
        return max(10, round(of_all / light.lost))

    def _valid(self, mean: NDArray[np.float64], cycles: int) -> NDArray[np.bool_]:
        """Return which pixels are believed of counts that pile-up was taken out of."""
        chance = -np.expm1(-mean / cycles)
        left = np.full(mean.shape[:2], cycles)
        counts = np.zeros(mean.shape)
        for k in range(BINS):
            counts[..., k] = seen = self._rng.binomial(left, chance[..., k])
            if self.axis.orientation == "histogram":
                left -= seen
        made = without_pile_up(counts.reshape(-1, BINS), cycles, self.axis.orientation)
        grown = None
        if made.worst.max() >= LITTLE_LOST:
            grown = growth(self._sharpener.fitter, made.counts, cycles).reshape(mean.shape[:2])
        cube, blind = made.counts.reshape(mean.shape), made.blind.reshape(mean.shape[:2])
        return self._sharpener.strip(cube, blind=blind, growth=grown).valid[0]
