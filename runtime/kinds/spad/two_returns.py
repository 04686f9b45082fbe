"""Two surfaces in one pixel: both pulses and the background fitted together.

Mean counts a1 s_k(mu1) + a2 s_k(mu2) + b. Maximum likelihood by Fisher scoring: each step solves
the five by five information, and is shortened until the likelihood rises. It begins from several
places: the second pulse where the residual of the first asks for it most, and both to either side
of the first, which is where one pulse lies that stands for two.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.runtime.kinds.spad.bank import Bank
from camkit.runtime.kinds.spad.fit import Fit

STEPS: Final = 25
CUTS: Final = 4
SIDES: Final = (0.6, 1.5, 3.0)
"""Of the standard deviation of an edge: how far to either side of one pulse two begin."""
ENOUGH: Final = 1e-4
BLOCK: Final = 2048

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoReturns:
    """What was found of some pixels; the nearer surface comes first.

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


def fit_two(bank: Bank, counts: FloatArray, one: Fit) -> TwoReturns:
    """Fit two returns to every pixel.

    Args:
        bank: Templates of the pulse on the axis.
        counts: (p, bins) >= 0.
        one: What the fit of one return gave of the same pixels.
    """
    parts = [
        _fit_block(bank, counts[rows].astype(np.float64), one, rows)
        for rows in (
            slice(start, min(start + BLOCK, len(counts)))
            for start in range(0, max(len(counts), 1), BLOCK)
        )
    ]
    found, evidence, sigmas = (np.concatenate(p, axis=-1) for p in zip(*parts, strict=True))
    order = np.argsort(found[:2], axis=0)
    return TwoReturns(
        times_of_flight_ps=np.take_along_axis(found[:2], order, 0),
        amplitudes=np.take_along_axis(found[2:4], order, 0),
        background=found[4],
        sigmas_ps=np.take_along_axis(sigmas, order, 0),
        evidence=evidence,
    )


def _fit_block(bank: Bank, counts: Floats, one: Fit, rows: slice) -> tuple[Floats, Floats, Floats]:
    """Give parameters (5, p), evidence (p,) and sigmas (2, p) of a block."""
    mu, a = one.time_of_flight_ps[rows], np.maximum(one.amplitude[rows], 0.1)
    b = np.maximum(one.background[rows], 1e-6)
    alone = np.stack([mu, mu, a / 2, a / 2, b])
    alone, base = _ascend(bank, counts, alone, is_one=True)
    spread = bank.pulse.finest_ps
    starts = [
        np.stack([alone[0] - side * spread, alone[0] + side * spread, a / 2, a / 2, b])
        for side in SIDES
    ]
    second, extra = _asked_for(bank, counts, alone)
    starts.append(np.stack([alone[0], second, np.maximum(a - extra, 0.1 * a), extra, b]))
    best, most = alone, base
    for start in starts:
        found, height = _ascend(bank, counts, start)
        better = height > most
        best, most = np.where(better, found, best), np.where(better, height, most)
    mean, gradients = _model(bank, best)
    sigmas = np.sqrt(np.linalg.inv(_fisher(mean, gradients))[:, [0, 1], [0, 1]]).T
    return best, np.maximum(2 * (most - base), 0.0), sigmas


def _asked_for(bank: Bank, counts: Floats, alone: Floats) -> tuple[Floats, Floats]:
    """Give where the residual of one return asks most for another, and how many photons of it."""
    mean, _ = _model(bank, alone)
    whole = np.zeros((len(bank.mu_ps), bank.axis.bins))
    rows = np.repeat(np.arange(len(whole)), bank.bins.shape[1])
    np.add.at(whole, (rows, bank.bins.ravel()), bank.shares.ravel())
    wish = (counts / mean) @ whole.T - bank.totals
    curvature = (1 / mean) @ (whole * whole).T
    gain = np.maximum(wish, 0.0) ** 2 / curvature
    index = gain.argmax(axis=1)
    at = np.arange(len(counts)), index
    return bank.mu_ps[index], np.maximum(wish[at] / curvature[at], 0.1)


def _model(bank: Bank, values: Floats) -> tuple[Floats, Floats]:
    """Give mean counts (p, bins) and their derivatives (p, 5, bins) at (5, p) parameters."""
    count, bins = values.shape[1], bank.axis.bins
    every = np.broadcast_to(np.arange(bins), (count, bins))
    shares = [bank.axis.shares(bank.pulse, values[i], every) for i in (0, 1)]
    slopes = [bank.axis.slopes(bank.pulse, values[i], every) for i in (0, 1)]
    mean = values[2][:, None] * shares[0] + values[3][:, None] * shares[1] + values[4][:, None]
    gradients = np.stack(
        [
            values[2][:, None] * slopes[0],
            values[3][:, None] * slopes[1],
            *shares,
            np.ones((count, bins)),
        ],
        axis=1,
    )
    return mean, gradients


def _fisher(mean: Floats, gradients: Floats) -> Floats:
    """Give the information (p, 5, 5), a little of its diagonal added so that it can be solved."""
    scaled = gradients / np.sqrt(mean)[:, None]
    found = scaled @ scaled.transpose(0, 2, 1)
    diagonal = np.einsum("pii->pi", found)
    diagonal += 1e-6 * diagonal + 1e-12
    return np.asarray(found)


def _height(counts: Floats, mean: Floats) -> Floats:
    return np.asarray((counts * np.log(mean) - mean).sum(axis=1))


def _ascend(
    bank: Bank, counts: Floats, start: Floats, *, is_one: bool = False
) -> tuple[Floats, Floats]:
    """Climb the likelihood; with `is_one` both pulses stay the same one."""
    values = start.copy()
    height = np.full(len(counts), -np.inf)
    going = np.arange(len(counts))
    for _ in range(STEPS):
        mean, gradients = _model(bank, values[:, going])
        height[going] = _height(counts[going], mean)
        step = _step(bank, counts[going], mean, gradients, is_one=is_one)
        tried, risen = _highest(bank, counts[going], values[:, going], step, height[going])
        values[:, going] = tried
        height[going] += risen
        going = going[risen > ENOUGH]
        if not len(going):
            break
    return values, height


def _step(bank: Bank, counts: Floats, mean: Floats, gradients: Floats, *, is_one: bool) -> Floats:
    """Give the step of Fisher scoring, (5, p)."""
    wish = np.einsum("pgk,pk->pg", gradients, counts / mean - 1)
    step = np.linalg.solve(_fisher(mean, gradients), wish[..., None])[..., 0].T
    if is_one:
        step[:2] = step[:2].mean(axis=0)
        step[2:4] = step[2:4].mean(axis=0)
    reach = 2 * bank.pulse.finest_ps
    step[:2] = np.clip(step[:2], -reach, reach)
    return step


def _highest(
    bank: Bank, counts: Floats, values: Floats, step: Floats, height: Floats
) -> tuple[Floats, Floats]:
    """Go a step, else a third of it and so on until it rises; give its end, and the rise."""
    found, risen = values.copy(), np.zeros(len(height))
    left = np.arange(len(height))
    for cut in range(CUTS):
        tried = values[:, left] + step[:, left] / 3**cut
        tried[:2] = np.clip(tried[:2], bank.mu_ps[0], bank.mu_ps[-1])
        tried[2:4] = np.maximum(tried[2:4], 1e-3)
        tried[4] = np.maximum(tried[4], 1e-6)
        rise = _height(counts[left], _model(bank, tried)[0]) - height[left]
        better = rise > 0
        found[:, left[better]] = tried[:, better]
        risen[left[better]] = rise[better]
        left = left[~better]
        if not len(left):
            break
    return found, risen
