"""Pulses at many times of flight over one time axis, and how well each fits counts.

Counts n with mean a (s(mu) + r), r = background of a bin over signal, have over all amplitudes a
the log likelihood

    sum_k n_k log((s_k(mu) + r) / (S(mu) + r K)),   S = sum_k s_k

up to what does not depend on mu (Poisson; the amplitude that is best for each mu put in). Outside
the pulse s is 0, so the sum runs over its band of bins, and the rest is a constant of mu times the
number of photons: a matrix product of counts with a narrow bank.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis

STEPS_PER_EDGE: Final = 4
"""Templates per standard deviation of a pulse's steepest edge."""
NARROW: Final = 0.25
"""Of a bin: an edge that is steeper is not resolved, and templates lie half a bin apart."""
GROUP: Final = 32
MOST_TEMPLATES: Final = 65_536
NEAR_SHARE: Final = 0.02
"""Of the peak of a template: a bin with less is taken for background."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bank:
    """Templates of one pulse on one axis.

    Attributes:
        axis: The time axis.
        pulse: The shape.
        mu_ps: (m,) their times of flight, equally far apart.
        bins: (m, b) the bins of each; bins beyond the axis are bin 0 with no share.
        shares: (m, b) what each sees there.
        slopes: (m, b) derivative of the shares by the time of flight, 1/ps.
        totals: (m,) sum of the shares.
        near: (m, 2) first bin, and the one after the last, where the pulse is seen.
    """

    axis: TimeAxis
    pulse: Pulse
    mu_ps: NDArray[np.float64]
    bins: NDArray[np.int64]
    shares: NDArray[np.float64]
    slopes: NDArray[np.float64]
    totals: NDArray[np.float64]
    near: NDArray[np.int64]

    @property
    def step_ps(self) -> float:
        """Return how far templates lie apart."""
        return float(self.mu_ps[1] - self.mu_ps[0])

    @property
    def resolved_ps(self) -> float:
        """Return the width of bins within which a pulse's place does not show; 0 if it does."""
        is_narrow = self.pulse.finest_ps < NARROW * self.axis.step_ps
        return self.axis.step_ps if is_narrow and self.axis.orientation == "histogram" else 0.0


def make_bank(axis: TimeAxis, pulse: Pulse) -> Bank:
    """Compute templates over an axis, wherever half of a pulse or more is seen.

    Raises:
        ContractError: If it would take too many.
    """
    is_narrow = pulse.finest_ps < NARROW * axis.step_ps
    step = axis.step_ps / 2 if is_narrow else pulse.finest_ps / STEPS_PER_EDGE
    centres, mean = axis.centres_ps, axis.mean_ps(pulse)
    count = int(np.floor((centres[-1] - centres[0]) / step + 1e-9)) + 1
    if count > MOST_TEMPLATES:
        raise ContractError(
            f"a pulse whose edges take {pulse.finest_ps:.3g} ps on an axis of "
            f"{axis.bins * axis.step_ps:.3g} ps needs {count} templates; at most "
            f"{MOST_TEMPLATES}: widen the pulse or cut the axis"
        )
    mu = centres[0] - mean + step * np.arange(max(count, 3))
    low, high = axis.reach_ps(pulse)
    first = np.searchsorted(axis.edges_ps, mu + low, side="right") - 1
    last = np.searchsorted(axis.edges_ps, mu + high, side="left")
    width = max(1, int((np.minimum(last, axis.bins) - np.maximum(first, 0)).max()))
    bins = np.maximum(first, 0)[:, None] + np.arange(width)
    is_there = bins < np.minimum(last, axis.bins)[:, None]
    bins = np.where(is_there, bins, 0)
    shares = np.where(is_there, axis.shares(pulse, mu, bins), 0.0)
    slopes = np.where(is_there, axis.slopes(pulse, mu, bins), 0.0)
    is_near = shares > NEAR_SHARE * shares.max(axis=1, keepdims=True)
    near = np.stack(
        [
            np.where(is_near, bins, axis.bins).min(axis=1),
            np.where(is_near, bins, -1).max(axis=1) + 1,
        ],
        axis=1,
    )
    return Bank(
        axis=axis,
        pulse=pulse,
        mu_ps=mu,
        bins=bins,
        shares=shares,
        slopes=slopes,
        totals=shares.sum(axis=1),
        near=near,
    )


class Banded:
    """Values of templates in their bands of bins, made ready for products with counts."""

    def __init__(self, bank: Bank, rows: NDArray[np.int64], values: NDArray[np.float64]) -> None:
        """Compute the narrow matrices.

        Args:
            bank: The templates.
            rows: (n,) which of them.
            values: (n, b) of each in its band; what lies beyond the axis is left out.
        """
        self._count = len(rows)
        self._parts: list[tuple[slice, slice, FloatArray]] = []
        for start in range(0, len(rows), GROUP):
            group = slice(start, min(start + GROUP, len(rows)))
            bins, has_share = bank.bins[rows[group]], bank.shares[rows[group]] > 0
            left = int(np.where(has_share, bins, bank.axis.bins).min())
            right = int(np.where(has_share, bins, 0).max()) + 1
            matrix = np.zeros((max(right - left, 1), group.stop - start), np.float32)
            at, bin_at = np.nonzero(has_share)
            matrix[bins[at, bin_at] - left, at] = values[group][at, bin_at]
            self._parts.append((slice(left, max(right, left + 1)), group, matrix))

    def product(self, counts: FloatArray) -> FloatArray:
        """Return the sum over bins of counts (p, bins) times values: (p, n) float32."""
        sums = np.empty((len(counts), self._count), np.float32)
        for columns, group, matrix in self._parts:
            np.matmul(counts[:, columns], matrix, out=sums[:, group])
        return sums


class Scorer:
    """A bank at one ratio of background to signal, made ready for products with counts."""

    def __init__(self, bank: Bank, ratio: float, every: int = 1) -> None:
        """Compute the narrow matrices.

        Args:
            bank: The templates.
            ratio: r, background of a bin over signal photons, > 0.
            every: Take each template of so many.
        """
        rows = np.arange(0, len(bank.mu_ps), every)
        self._offset = (np.log(ratio) - np.log(bank.totals[rows] + ratio * bank.axis.bins)).astype(
            np.float32
        )
        self._logs = Banded(bank, rows, np.log1p(bank.shares[rows] / ratio))

    def score(self, counts: FloatArray, photons: FloatArray) -> FloatArray:
        """Return the log likelihood of every template.

        Args:
            counts: (p, bins) float32.
            photons: (p,) their sums.

        Returns:
            (p, m) float32; those of an empty pixel are 0.
        """
        logs = self._logs.product(counts)
        logs += photons[:, None] * self._offset
        return logs
