"""A detector that is blind after a photon, with and without correction.

Gate scan: every step sees at most one photon a cycle. Free running: the first photon of a cycle
stops it. The value is the chance of a photon in the brightest bin and cycle; the bound is that of a
detector that is never blind.
"""

from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.report.kinds.spad.synthetic import AXIS, PULSE
from camkit.runtime.kinds.spad.bound import information
from camkit.runtime.kinds.spad.pile_up import without_pile_up
from camkit.runtime.kinds.spad.scatter import growth
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way
from camkit.runtime.kinds.spad.time_axis import Orientation
from tools.spad.limit.judged import Sweep, judged, swept

CHANCES: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.75, 0.85, 0.95)
CYCLES: Final = 1000
DARK_SHARE: Final = 0.002
"""Of the brightest bin's rate: background of every bin."""
SHAPE: Final = (32, 64)
SPAN_PS: Final = (700.0, 1900.0)


def sweeps() -> list[Sweep]:
    """Measure both kinds of scan, corrected and left as they are."""
    names = {"gate": "gate scan", "histogram": "free running"}
    return [
        swept(
            f"pile-up, {name}, {'corrected' if corrected else 'left'}",
            "chance a bin",
            CHANCES,
            lambda p, o=orientation, c=corrected: _point(p, o, corrected=c),  # type: ignore[misc]
        )
        for orientation, name in names.items()
        for corrected in (False, True)
    ]


def _point(chance: float, orientation: Orientation, *, corrected: bool) -> dict[str, Any]:
    rng = np.random.default_rng(int(1000 * chance))
    axis = replace(AXIS, orientation=orientation)
    times = rng.uniform(*SPAN_PS, SHAPE[0] * SHAPE[1])
    every = np.broadcast_to(np.arange(axis.bins), (len(times), axis.bins))
    shares = axis.shares(PULSE, times, every)
    top = -np.log1p(-chance)
    rates = top * (shares / shares.max() + DARK_SHARE)
    counts = _seen(rates, orientation, rng)
    photons, even = CYCLES * top / shares.max(), CYCLES * top * DARK_SHARE
    blind, grown = np.zeros(len(times), bool), None
    sharpener = Sharpener(axis, PULSE, Way(pool="1"))
    if corrected:
        undone = without_pile_up(counts, CYCLES, orientation)
        counts, blind = undone.counts, undone.blind
        grown = growth(sharpener.fitter, counts, CYCLES).reshape(SHAPE)
    found = sharpener.strip(
        counts.reshape(*SHAPE, axis.bins), blind=blind.reshape(SHAPE), growth=grown
    )
    bank = sharpener.fitter.bank
    bounds = 1 / np.sqrt(photons * np.interp(times, bank.mu_ps, information(bank, even / photons)))
    errors = found.time_of_flight_ps.ravel() - times
    return judged(
        chance,
        errors,
        bounds,
        found.valid.ravel(),
        sigma_68=float(np.quantile(np.abs(errors) / found.sigma_ps.ravel(), 0.6827)),
        bias_ps=float(np.median(errors)),
        amplitude=float(np.median(found.amplitude) / photons),
    )


def _seen(
    rates: NDArray[np.float64], orientation: Orientation, rng: np.random.Generator
) -> FloatArray:
    fired = -np.expm1(-rates)
    if orientation == "gate":
        return rng.binomial(CYCLES, fired).astype(np.float32)
    before = np.concatenate([np.zeros((len(rates), 1)), np.cumsum(rates, axis=1)[:, :-1]], axis=1)
    chances = np.exp(-before) * fired
    rest = np.maximum(1 - chances.sum(axis=1, keepdims=True), 0.0)
    drawn = rng.multinomial(CYCLES, np.concatenate([chances, rest], axis=1))
    return drawn[:, :-1].astype(np.float32)
