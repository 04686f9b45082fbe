"""The time axis of a cube of counts: bins of a histogram, or delays of a gate."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.pulse import Pulse

Orientation = Literal["gate", "histogram"]
LEAST_BINS = 8
Shares = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeAxis:
    """The bins of a time axis.

    Attributes:
        orientation: histogram: a bin holds the photons that came in it, p(t - mu). gate: a bin is a
            delay of the gate, which sees p(mu - t) of the photons: a later gate sees the pulse
            run backwards.
        edges_ps: (bins + 1,) increasing. The delay of a gate is the middle of its bin.
    """

    orientation: Orientation
    edges_ps: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.orientation not in ("gate", "histogram"):
            raise ContractError(f"orientation must be gate or histogram; got {self.orientation!r}")
        edges = self.edges_ps
        if edges.ndim != 1 or len(edges) < LEAST_BINS + 1:
            raise ContractError(
                f"times need at least {LEAST_BINS} bins; got {max(0, edges.size - 1)}"
            )
        with np.errstate(invalid="ignore"):
            steps = np.diff(edges)
        if not np.isfinite(edges).all() or (steps < 0).any() or edges[0] == edges[-1]:
            first = int(np.argmax(~(np.isfinite(steps) & (steps >= 0))))
            raise ContractError(
                f"edges of time bins must be finite and increase; got {edges[first + 1]:g} ps "
                f"after {edges[first]:g} ps"
            )

    @classmethod
    def regular(
        cls, orientation: Orientation, *, bins: int, time_bin_ps: float, first_ps: float = 0.0
    ) -> "TimeAxis":
        """Return an axis of equal bins.

        Args:
            orientation: See the class.
            bins: How many.
            time_bin_ps: Width of each.
            first_ps: Centre of the first; the delay of the first gate.

        Raises:
            ContractError: If there are too few, or the width is not > 0.
        """
        if not 0 < time_bin_ps < 1e12:
            raise ContractError(f"time_bin_ps must be > 0 and < 1e12; got {time_bin_ps}")
        edges = first_ps + (np.arange(bins + 1, dtype=np.float64) - 0.5) * time_bin_ps
        return cls(orientation=orientation, edges_ps=edges)

    @property
    def bins(self) -> int:
        """Return how many bins there are."""
        return len(self.edges_ps) - 1

    @property
    def centres_ps(self) -> NDArray[np.float64]:
        """Return the middle of every bin."""
        return np.asarray((self.edges_ps[1:] + self.edges_ps[:-1]) / 2)

    @property
    def step_ps(self) -> float:
        """Return the mean width of a bin."""
        return float((self.edges_ps[-1] - self.edges_ps[0]) / self.bins)

    def shares(self, pulse: Pulse, mu_ps: NDArray[np.float64], bins: NDArray[np.int64]) -> Shares:
        """Return the share of a pulse's photons that each bin sees.

        Over an axis that holds the whole pulse they sum to 1: exactly for a histogram, and for
        gates whose steps are equal and finer than their edges.

        Args:
            pulse: Its shape.
            mu_ps: (m,) times of flight.
            bins: (m, b) which bins; they must exist.

        Returns:
            (m, b).
        """
        if self.orientation == "gate":
            u = mu_ps[:, None] - self.centres_ps[bins]
            # a gate sees p of the light whatever the distance to the next gate
            return np.asarray(pulse.density(u) * self.step_ps)
        left = pulse.cdf(self.edges_ps[bins] - mu_ps[:, None])
        right = pulse.cdf(self.edges_ps[bins + 1] - mu_ps[:, None])
        return np.asarray(np.maximum(right - left, 0.0))

    def slopes(self, pulse: Pulse, mu_ps: NDArray[np.float64], bins: NDArray[np.int64]) -> Shares:
        """Return the derivative of `shares` by the time of flight, 1/ps; arguments as there."""
        if self.orientation == "gate":
            h = pulse.finest_ps / 50
            u = mu_ps[:, None] - self.centres_ps[bins]
            return np.asarray(
                (pulse.density(u + h) - pulse.density(u - h)) * self.step_ps / (2 * h)
            )
        left = pulse.density(self.edges_ps[bins] - mu_ps[:, None])
        right = pulse.density(self.edges_ps[bins + 1] - mu_ps[:, None])
        return np.asarray(left - right)

    def reach_ps(self, pulse: Pulse) -> tuple[float, float]:
        """Return from where to where a pulse is seen, relative to its time of flight."""
        if self.orientation == "gate":
            return -pulse.end_ps, -pulse.start_ps
        return pulse.start_ps, pulse.end_ps

    def mean_ps(self, pulse: Pulse) -> float:
        """Return where a pulse is seen on average, relative to its time of flight."""
        return -pulse.mean_ps if self.orientation == "gate" else pulse.mean_ps
