"""Two surfaces in one pixel: both pulses and the background fitted together, where asked for.

Mean counts a1 s_k(mu1) + a2 s_k(mu2) + b. Maximum likelihood by Fisher scoring: each step solves
the five by five information, and is shortened until the likelihood rises. It begins from several
places, of which the better ones are followed to the end: the second pulse where the residual of the
first asks for it most, and both to either side of the first, which is where one pulse lies that
stands for two.

Few pixels see two surfaces, so the residual of one return is asked first (`asks_for_second`): the
gain of the likelihood that a little of a second pulse anywhere would bring, to second order.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.spad.bank import Banded, Bank
from camkit.runtime.kinds.spad.fit import Fit
from camkit.runtime.kinds.spad.template_cubics import Floats, TemplateCubics

STEPS: Final = 25
TRIAL_STEPS: Final = 3
"""Steps from every place, before the better ones are followed."""
FOLLOWED: Final = 2
CUTS: Final = 4
SIDES: Final = (0.6, 1.5, 3.0)
"""Of the standard deviation of an edge: how far to either side of one pulse two begin."""
ENOUGH: Final = 1e-3
BLOCK_COUNTS: Final = 262_144
"""Counts that are fitted at once."""
LEAST_GAIN: Final = 5.0
"""Gain of the likelihood, twice its logarithm, from which on a second pulse is tried."""
LEAST_BACKGROUND: Final = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoReturns:
    """The fits of some pixels; the nearer surface comes first.

    Attributes:
        times_of_flight_ps: (2, p).
        amplitudes: (2, p) signal photons.
        background: (p,) counts of a bin.
        sigmas_ps: (2, p) standard deviations that the times should have.
        evidence: (p,) twice the log likelihood over one return.
    """

    times_of_flight_ps: Floats
    amplitudes: Floats
    background: Floats
    sigmas_ps: Floats
    evidence: Floats


class TwoFitter:
    """A bank with what fits of two returns need of it, made when first needed."""

    def __init__(self, bank: Bank) -> None:
        self._bank = bank

    @cached_property
    def _cubics(self) -> TemplateCubics:
        return TemplateCubics(self._bank)

    @cached_property
    def _sums(self) -> tuple[Banded, Banded]:
        """Return the templates, and their squares, for products with (p, bins)."""
        every = np.arange(len(self._bank.mu_ps))
        return Banded(self._bank, every, self._bank.shares), Banded(
            self._bank, every, self._bank.shares**2
        )

    def asks_for_second(self, counts: FloatArray, one: Fit) -> NDArray[np.bool_]:
        """Return which pixels have a residual that a second return may explain.

        Args:
            counts: (p, bins) >= 0.
            one: What the fit of one return gave of the same pixels.
        """
        asks = np.zeros(len(counts), dtype=bool)
        for rows in self._blocks(len(counts)):
            mean = self._mean_of_one(one, rows)
            asks[rows] = self._wish(counts[rows], mean)[0].max(axis=1, initial=0) > LEAST_GAIN
        return asks

    def fit(self, counts: FloatArray, one: Fit) -> TwoReturns:
        """Fit two returns to every pixel; arguments as of `asks_for_second`."""
        parts = [
            self._fit_block(counts[rows].astype(np.float64), one, rows)
            for rows in self._blocks(len(counts))
        ]
        values, evidence, sigmas = (np.concatenate(p, axis=-1) for p in zip(*parts, strict=True))
        order = np.argsort(values[:2], axis=0)
        return TwoReturns(
            times_of_flight_ps=np.take_along_axis(values[:2], order, 0),
            amplitudes=np.take_along_axis(values[2:4], order, 0),
            background=values[4],
            sigmas_ps=np.take_along_axis(sigmas, order, 0),
            evidence=evidence,
        )

    def _blocks(self, count: int) -> list[slice]:
        size = max(1, BLOCK_COUNTS // self._bank.axis.bins)
        return [slice(at, min(at + size, count)) for at in range(0, max(count, 1), size)]

    def _mean_of_one(self, one: Fit, rows: slice) -> Floats:
        bank = self._bank
        mu = np.clip(one.time_of_flight_ps[rows], bank.mu_ps[0], bank.mu_ps[-1])
        shares, _ = self._cubics.shapes(mu)
        background = np.maximum(one.background[rows], LEAST_BACKGROUND)
        return np.asarray(one.amplitude[rows, None] * shares + background[:, None])

    def _wish(self, counts: NDArray[Any], mean: Floats) -> tuple[Floats, Floats]:
        """Return the gain of a second pulse at every template, and its photons: (p, m) each."""
        shares, squares = self._sums
        wish = shares.product((counts / mean).astype(np.float32)).astype(np.float64)
        wish -= self._bank.totals
        np.maximum(wish, 0.0, out=wish)
        curvature = squares.product((np.maximum(counts, mean) / mean**2).astype(np.float32))
        photons = wish / np.maximum(curvature, 1e-12)
        return wish * photons, photons

    def _fit_block(self, counts: Floats, one: Fit, rows: slice) -> tuple[Floats, Floats, Floats]:
        """Return parameters (5, p), evidence (p,) and sigmas (2, p) of a block."""
        bank = self._bank
        mu = np.clip(one.time_of_flight_ps[rows], bank.mu_ps[0], bank.mu_ps[-1])
        a, b = np.maximum(one.amplitude[rows], 0.1), np.maximum(one.background[rows], 1e-6)
        alone, base = self._ascend(counts, np.stack([mu, mu, a / 2, a / 2, b]), STEPS, is_one=True)
        places = self._starts(counts, alone, a, b)
        trials = [self._ascend(counts, place, TRIAL_STEPS) for place in places]
        heights = np.stack([height for _, height in trials])
        order = np.argsort(heights, axis=0)[::-1]
        values = np.stack([value for value, _ in trials])
        best, most = alone, base
        every = np.arange(len(counts))
        for rank in range(FOLLOWED):
            start = values[order[rank], :, every].T
            end, height = self._ascend(counts, start, STEPS)
            better = height > most
            best, most = np.where(better, end, best), np.where(better, height, most)
        mean, gradients = self._model(best)
        sigmas = np.sqrt(np.linalg.inv(_fisher(mean, gradients))[:, [0, 1], [0, 1]]).T
        return best, np.maximum(2 * (most - base), 0.0), sigmas

    def _starts(self, counts: Floats, alone: Floats, a: Floats, b: Floats) -> list[Floats]:
        """Return places (5, p) to begin from."""
        spread = self._bank.pulse.finest_ps
        low, high = self._bank.mu_ps[[0, -1]]
        starts = [
            np.stack(
                [
                    np.clip(alone[0] - side * spread, low, high),
                    np.clip(alone[0] + side * spread, low, high),
                    *(a / 2, a / 2, b),
                ]
            )
            for side in SIDES
        ]
        gain, photons = self._wish(counts, self._model(alone)[0])
        index = gain.argmax(axis=1)
        extra = np.maximum(photons[np.arange(len(counts)), index], 0.1)
        second = self._bank.mu_ps[index]
        starts.append(np.stack([alone[0], second, np.maximum(a - extra, 0.1 * a), extra, b]))
        return starts

    def _model(self, values: Floats) -> tuple[Floats, Floats]:
        """Return mean counts (p, bins) and their derivatives (p, 5, bins) at (5, p) parameters."""
        (s1, d1), (s2, d2) = (self._cubics.shapes(values[i]) for i in (0, 1))
        a1, a2, b = (values[i][:, None] for i in (2, 3, 4))
        gradients = np.stack([a1 * d1, a2 * d2, s1, s2, np.ones_like(s1)], axis=1)
        return a1 * s1 + a2 * s2 + b, gradients

    def _ascend(
        self, counts: Floats, start: Floats, steps: int, *, is_one: bool = False
    ) -> tuple[Floats, Floats]:
        """Maximise the likelihood; with `is_one` both pulses stay the same one."""
        values = start.copy()
        mean, gradients = self._model(values)
        height = _height(counts, mean)
        active = np.arange(len(counts))
        for _ in range(steps):
            step = self._step(counts[active], mean, gradients, is_one=is_one)
            new_values, risen = self._highest(
                counts[active], values[:, active], step, height[active]
            )
            values[:, active] = new_values
            height[active] += risen
            active = active[risen > ENOUGH]
            if not len(active):
                break
            mean, gradients = self._model(values[:, active])
        return values, height

    def _step(self, counts: Floats, mean: Floats, gradients: Floats, *, is_one: bool) -> Floats:
        """Return the step of Fisher scoring, (5, p)."""
        wish = (gradients @ (counts / mean - 1)[..., None])[..., 0]
        step = np.linalg.solve(_fisher(mean, gradients), wish[..., None])[..., 0].T
        if is_one:
            step[:2] = step[:2].mean(axis=0)
            step[2:4] = step[2:4].mean(axis=0)
        reach = 2 * self._bank.pulse.finest_ps
        step[:2] = np.clip(step[:2], -reach, reach)
        return np.asarray(step, np.float64)

    def _highest(
        self, counts: Floats, values: Floats, step: Floats, height: Floats
    ) -> tuple[Floats, Floats]:
        """Try a step, else a third of it and so on until it rises; return its end, and the rise."""
        best, risen = values.copy(), np.zeros(len(height))
        pending = np.arange(len(height))
        for cut in range(CUTS):
            new_values = values[:, pending] + step[:, pending] / 3**cut
            new_values[:2] = np.clip(new_values[:2], self._bank.mu_ps[0], self._bank.mu_ps[-1])
            new_values[2:4] = np.maximum(new_values[2:4], 1e-3)
            new_values[4] = np.maximum(new_values[4], LEAST_BACKGROUND)
            rise = _height(counts[pending], self._mean(new_values)) - height[pending]
            better = rise > 0
            best[:, pending[better]] = new_values[:, better]
            risen[pending[better]] = rise[better]
            pending = pending[~better]
            if not len(pending):
                break
        return best, risen

    def _mean(self, values: Floats) -> Floats:
        (s1, _), (s2, _) = (self._cubics.shapes(values[i]) for i in (0, 1))
        return np.asarray(values[2][:, None] * s1 + values[3][:, None] * s2 + values[4][:, None])


def _fisher(mean: Floats, gradients: Floats) -> Floats:
    """Return the information (p, 5, 5), a little of its diagonal added so that it can be solved."""
    scaled = gradients / np.sqrt(mean)[:, None]
    information = scaled @ scaled.transpose(0, 2, 1)
    diagonal = np.einsum("pii->pi", information)
    diagonal += 1e-6 * diagonal + 1e-12
    return np.asarray(information)


def _height(counts: Floats, mean: Floats) -> Floats:
    return np.asarray((counts * np.log(mean) - mean).sum(axis=1))
