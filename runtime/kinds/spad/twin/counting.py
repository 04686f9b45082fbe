"""Photons of the light that an array sees: Poisson, dark counts, hot pixels, blind times.

counts       each pixel counts for a time; after a photon it is blind for its dead time
gate         each step of a gate asks M laser cycles, each of which answers once at most
histogram    each of M cycles records its first photon alone: earlier bins hide later ones

References: Coates 1968 for the first photon of a cycle.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.files.counts_file import MOST_COUNT
from camkit.runtime.kinds.spad.time_axis import Orientation

CHANCE: Final = 6.0
"""Standard deviations that a count may lie above its mean."""
HOT_TIMES: Final = 50.0
"""Dark counts of a hot pixel over those of others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbances:
    """The counts of an array without light, and the photons that it misses.

    Attributes:
        dark: Dark counts of a pixel and bin, or of a pixel that only counts.
        hot: (h, w) pixels that count far more; None for none.
        hot_counts: What they count without light; None for `HOT_TIMES` times `dark`.
        cycles: Laser cycles of a bin or step; 0 for so many that none is missed.
        dead_share: Dead time over the time for which a pixel that only counts does so.
    """

    dark: float = 0.0
    hot: NDArray[np.bool_] | None = None
    hot_counts: float | None = None
    cycles: int = 0
    dead_share: float = 0.0

    def __post_init__(self) -> None:
        for name in ("dark", "dead_share"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ContractError(f"{name} must be a number >= 0; got {value}")
        if self.cycles < 0:
            raise ContractError(f"cycles must be >= 0; got {self.cycles}")

    def added(self, mean: NDArray[np.float64]) -> NDArray[np.float64]:
        """Add what comes without light to mean counts (n, h, w)."""
        counts = mean + self.dark
        if self.hot is not None:
            extra = HOT_TIMES * self.dark if self.hot_counts is None else self.hot_counts
            counts[:, self.hot] += extra
        return counts


def count_frames(
    mean: NDArray[np.floating], disturbances: Disturbances, rng: np.random.Generator
) -> NDArray[np.uint32]:
    """Count for a time.

    Args:
        mean: (n, h, w) photons of every pixel and frame on average, >= 0.
        disturbances: What comes on top, and what is missed.
        rng: Source of chance.

    Raises:
        ContractError: If there are more photons than `process` reads.
    """
    expected = disturbances.added(np.asarray(mean, np.float64))
    expected /= 1 + expected * disturbances.dead_share
    _check_most(expected)
    return np.asarray(rng.poisson(expected), dtype=np.uint32)


def count_times(
    mean: NDArray[np.floating],
    orientation: Orientation,
    disturbances: Disturbances,
    rng: np.random.Generator,
) -> NDArray[np.uint32]:
    """Count by time; arguments and errors as of `count_frames`, with (bins, h, w)."""
    expected = disturbances.added(np.asarray(mean, np.float64))
    cycles = disturbances.cycles
    _check_most(np.minimum(expected, cycles) if cycles else expected)
    if cycles == 0:
        return np.asarray(rng.poisson(expected), dtype=np.uint32)
    answered = -np.expm1(-expected / cycles)
    if orientation == "gate":
        return np.asarray(rng.binomial(cycles, answered), dtype=np.uint32)
    counts = np.empty(expected.shape, np.uint32)
    free_cycles = np.full(expected.shape[1:], cycles)
    for place, share in enumerate(answered):
        counts[place] = rng.binomial(free_cycles, share)
        free_cycles -= counts[place]
    return counts


def _check_most(expected: NDArray[np.float64]) -> None:
    """Refuse counts that no reader takes for exact, chance at its brightest included."""
    peak = float(expected.max(initial=0.0))
    if not peak + CHANCE * math.sqrt(peak) <= MOST_COUNT:
        raise ContractError(
            f"the brightest pixel would count {peak:.3g} photons in one picture or time bin, and "
            f"captures hold at most {MOST_COUNT}; take fewer photons"
        )


def scaled_to(light: FloatArray, photons: float) -> NDArray[np.float64]:
    """Return light by time (bins, h, w) as photons, `photons` of a pixel in all bins on average.

    Raises:
        ContractError: If there is no light, or no number of photons >= 0.
    """
    if not (math.isfinite(photons) and photons >= 0):
        raise ContractError(f"photons must be a number >= 0; got {photons}")
    total = float(light.sum(dtype=np.float64)) / light[0].size
    if total <= 0:
        raise ContractError("the scene sends no light within the time bins")
    return np.asarray(light.astype(np.float64) * (photons / total))
