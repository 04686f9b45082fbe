"""Pile-up: a detector that fired is blind, so late photons and bright gates are seen too rarely.

Gate scan: every step opens the gate in `cycles` cycles, each of which sees one photon at most. The
rate of a cycle is -log(1 - n / cycles), whatever came before.

Histogram, free running: the first photon of a cycle stops it, so bin k had only those cycles left
that no earlier bin took: rate_k = -log(1 - n_k / (cycles - sum_{j<k} n_j)).

References: P. B. Coates, "The correction for photon 'pile-up' in the measurement of radiative
lifetimes", J. Phys. E 1 (1968).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.time_axis import Orientation

LEAST_LEFT: Final = 0.02
"""Of the cycles: with fewer left a bin tells nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PileUp:
    """Counts as a detector that is never blind would have given them.

    Attributes:
        counts: (p, bins) float32, photons that came in all cycles.
        blind: (p,) whether some bins were full, and hold the most that can be told, or told
            nothing, and hold 0.
        worst: (p,) the largest share of cycles that a bin lost, or a gate used.
    """

    counts: FloatArray
    blind: NDArray[np.bool_]
    worst: NDArray[np.float64]


def without_pile_up(counts: FloatArray, cycles: int, orientation: Orientation) -> PileUp:
    """Undo pile-up.

    Args:
        counts: (p, bins) >= 0.
        cycles: Laser cycles, of each step for a gate, in all for a histogram.
        orientation: Of the time axis.

    Raises:
        ContractError: If there are more counts than cycles.
    """
    if cycles < 1:
        raise ContractError(f"cycles must be >= 1; got {cycles}")
    measured = counts.astype(np.float64)
    earlier = np.zeros_like(measured)
    if orientation == "histogram":
        np.cumsum(measured[:, :-1], axis=1, out=earlier[:, 1:])
    free_cycles = cycles - earlier
    most = float((earlier + measured).max(initial=0.0))
    if most > cycles:
        raise ContractError(
            f"counts go up to {most:.0f}, above the {cycles} cycles in which they can have come; "
            "correct cycles, or state 0 where they are not known"
        )
    is_correctable = free_cycles - measured >= LEAST_LEFT * cycles
    most_told = np.maximum(1 - LEAST_LEFT * cycles / np.maximum(free_cycles, 1e-9), 0.0)
    chance = np.minimum(measured / np.maximum(free_cycles, 1.0), most_told)
    return PileUp(
        counts=(-cycles * np.log1p(-chance)).astype(np.float32),
        blind=np.asarray(~is_correctable.all(axis=1)),
        worst=np.asarray(1 - (free_cycles - measured).min(axis=1) / cycles),
    )
