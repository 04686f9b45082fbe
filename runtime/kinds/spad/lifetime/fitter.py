"""The likeliest lifetime of every pixel: Poisson counts of mean a s_k(mu, tau) + b.

    counts -> best templates of a coarse bank -> a and b that fit them, the likelier goes on
           -> Fisher scoring of log tau, mu, a and b together, each step cut until it rises

Lifetimes are as far from Gaussian as they are wide; their logarithm is closer, so it is fitted, and
sigma is that of the logarithm times the lifetime, by the Cramer-Rao bound.
"""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.evidence import threshold_for
from camkit.runtime.kinds.spad.lifetime.decay import Decay, Floats, Shapes
from camkit.runtime.kinds.spad.lifetime.starts import Starts
from camkit.runtime.kinds.spad.pooling import FALSE_ALARMS

STEPS: Final = 30
CUTS: Final = 5
SHARED: Final = 8
"""Steps by which photons are first shared out to decay and background."""
ENOUGH: Final = 1e-3
BLOCK_COUNTS: Final = 200_000
FLOOR: Final = 1e-6
"""Counts of a bin; no background is less."""
LEAST_AMPLITUDE: Final = 1e-3
FASTEST: Final = 0.25
"""Shortest lifetime looked for, of a bin or of the pulse's edge, whichever is more."""
SLOWEST: Final = 2.0
"""Longest, of the span of the axis."""
LARGEST_STEP: Final = 0.7
LEAST_KNOWN: Final = 0.5
"""Sigma over lifetime above which nothing is known of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lifetimes:
    """The fitted lifetimes of some pixels; all arrays (p,).

    Attributes:
        lifetime_ps: tau.
        time_of_flight_ps: mu, the time of the pulse.
        amplitude: Photons of the decay, those after the axis too.
        background: Counts of a bin.
        sigma_ps: Standard deviation that the lifetime should have.
        evidence: Twice the log likelihood over background alone.
        is_determined: Whether the lifetime lies within the limits, not on them, and above twice its
            sigma.
    """

    lifetime_ps: Floats
    time_of_flight_ps: Floats
    amplitude: Floats
    background: Floats
    sigma_ps: Floats
    evidence: Floats
    is_determined: NDArray[np.bool_]


class LifetimeFitter:
    """A decay with what fits need of it, made when first needed.

    Attributes:
        decay: Pulse and axis.
        limits_ps: Shortest and longest lifetime that is looked for.
    """

    def __init__(self, decay: Decay, limits_ps: tuple[float, float] | None = None) -> None:
        """Store a decay and its limits.

        Raises:
            ContractError: If the limits are none.
        """
        axis = decay.axis
        if limits_ps is None:
            shortest = FASTEST * max(decay.pulse.finest_ps, axis.step_ps)
            limits_ps = shortest, SLOWEST * axis.step_ps * axis.bins
        if not 0 < limits_ps[0] < limits_ps[1] < np.inf:
            raise ContractError(f"limits of lifetimes must be > 0 and increase; got {limits_ps}")
        self.decay, self.limits_ps = decay, limits_ps

    @cached_property
    def _starts(self) -> Starts:
        return Starts(self.decay, *self.limits_ps)

    def threshold(self, false_alarms: float = FALSE_ALARMS) -> float:
        """Return the evidence from which on a decay is believed."""
        return threshold_for(false_alarms, self._starts.length)

    def fit(self, counts: FloatArray) -> Lifetimes:
        """Fit a decay to every pixel.

        Args:
            counts: (p, bins) float32, finite and >= 0.
        """
        size = max(1, BLOCK_COUNTS // self.decay.axis.bins)
        starts = range(0, max(len(counts), 1), size)
        parts = [self._fit_block(counts[at : at + size]) for at in starts]
        names = [field.name for field in fields(Lifetimes)]
        return Lifetimes(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})

    def _fit_block(self, counts: FloatArray) -> Lifetimes:
        n = counts.astype(np.float64)
        values, height = self._ascend(n, self._start(counts, n))
        mean, gradients = self._model(values)
        inverse = np.linalg.inv(_fisher(mean, gradients))
        photons = n.sum(axis=1)
        even = np.maximum(photons / n.shape[1], FLOOR)
        evidence = 2 * (height - photons * np.log(even) + even * n.shape[1])
        low, high = np.log(self.limits_ps)
        relative = np.sqrt(np.maximum(inverse[:, 0, 0], 0.0))
        inside = (values[0] > low + ENOUGH) & (values[0] < high - ENOUGH)
        return Lifetimes(
            lifetime_ps=np.exp(values[0]),
            time_of_flight_ps=values[1],
            amplitude=np.where(photons > 0, values[2], 0.0),
            background=values[3],
            sigma_ps=np.exp(values[0]) * relative,
            evidence=np.where(photons > 0, np.maximum(evidence, 0.0), 0.0),
            is_determined=inside & (relative < LEAST_KNOWN),
        )

    def _start(self, counts: FloatArray, n: Floats) -> Floats:
        """Return parameters (4, p) to begin from."""
        starts = self._starts
        best, most = np.empty((4, len(n))), np.full(len(n), -np.inf)
        for template in starts.best(counts):
            check_wish()
            shares = starts.shares(template)
            a, b = _shared_out(n, shares)
            height = _height(n, a[:, None] * shares + b[:, None])
            values = np.stack([np.log(starts.lifetime_ps[template]), starts.mu_ps[template], a, b])
            best = np.where(height > most, values, best)
            most = np.maximum(height, most)
        return best

    def _model(self, values: Floats) -> tuple[Floats, Floats]:
        """Return mean counts (p, bins) and their derivatives (p, 4, bins) at (4, p) parameters."""
        shapes: Shapes = self.decay.shapes(values[1], np.exp(values[0]))
        a, b = values[2][:, None], values[3][:, None]
        gradients = np.stack(
            [a * shapes.by_log, a * shapes.by_time, shapes.shares, np.ones_like(shapes.shares)],
            axis=1,
        )
        return a * shapes.shares + b, gradients

    def _ascend(self, counts: Floats, start: Floats) -> tuple[Floats, Floats]:
        """Maximise the likelihood from (4, p) parameters; return the maximum and its value."""
        values = start.copy()
        mean, gradients = self._model(values)
        height = _height(counts, mean)
        active = np.arange(len(counts))
        for _ in range(STEPS):
            check_wish()
            step = self._step(counts[active], mean, gradients, values[:, active])
            pending, risen = np.arange(len(active)), np.zeros(len(active))
            for cut in range(CUTS):
                at = active[pending]
                new_values = self._limited(values[:, at] + step[:, pending] / 3**cut)
                new_mean, new_gradients = self._model(new_values)
                rise = _height(counts[at], new_mean) - height[at]
                better = rise > 0
                values[:, at[better]] = new_values[:, better]
                height[at[better]] += rise[better]
                risen[pending[better]] = rise[better]
                mean[pending[better]] = new_mean[better]
                gradients[pending[better]] = new_gradients[better]
                pending = pending[~better]
                if not len(pending):
                    break
            is_rising = risen > ENOUGH
            active, mean, gradients = active[is_rising], mean[is_rising], gradients[is_rising]
            if not len(active):
                break
        return values, height

    def _step(self, counts: Floats, mean: Floats, gradients: Floats, values: Floats) -> Floats:
        """Return the step of Fisher scoring, (4, p); a background at its floor stays there."""
        wish = (gradients @ (counts / mean - 1)[..., None])[..., 0]
        matrix = _fisher(mean, gradients)
        floored = (values[3] <= 2 * FLOOR) & (wish[:, 3] < 0)
        wish[floored, 3] = 0.0
        matrix[floored, 3, :3] = matrix[floored, :3, 3] = 0.0
        step = np.linalg.solve(matrix, wish[..., None])[..., 0].T
        step[0] = np.clip(step[0], -LARGEST_STEP, LARGEST_STEP)
        reach = 3 * max(self.decay.pulse.finest_ps, self.decay.axis.step_ps)
        step[1] = np.clip(step[1], -reach, reach)
        return np.asarray(step)

    def _limited(self, values: Floats) -> Floats:
        values[0] = np.clip(values[0], *np.log(self.limits_ps))
        edges = self.decay.axis.edges_ps
        values[1] = np.clip(values[1], edges[0] - self.decay.pulse.end_ps, edges[-1])
        values[2] = np.maximum(values[2], LEAST_AMPLITUDE)
        values[3] = np.maximum(values[3], FLOOR)
        return values


def _shared_out(counts: Floats, shares: Floats) -> tuple[Floats, Floats]:
    """Return photons of a decay and counts of a bin that come near the likeliest, (p,) each."""
    photons, bins = counts.sum(axis=1), counts.shape[1]
    a, b = 0.8 * photons, 0.2 * photons / bins
    visible = np.maximum(shares.sum(axis=1), 1e-6)
    for _ in range(SHARED):
        of_decay = a[:, None] * shares
        part = counts / np.maximum(of_decay + b[:, None], FLOOR)
        a = (part * of_decay).sum(axis=1) / visible
        b = (part * b[:, None]).sum(axis=1) / bins
    return np.maximum(a, LEAST_AMPLITUDE), np.maximum(b, FLOOR)


def _fisher(mean: Floats, gradients: Floats) -> Floats:
    """Return the information (p, 4, 4), a little of its diagonal added so that it can be solved."""
    scaled = gradients / np.sqrt(mean)[:, None]
    information = scaled @ scaled.transpose(0, 2, 1)
    diagonal = np.einsum("pii->pi", information)
    diagonal += 1e-9 * diagonal + 1e-15
    return np.asarray(information)


def _height(counts: Floats, mean: Floats) -> Floats:
    return np.asarray((counts * np.log(mean) - mean).sum(axis=1))
