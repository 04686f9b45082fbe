"""Counts that pile-up was taken out of scatter more, and sigma says so."""

import numpy as np
import pytest

from camkit.runtime.kinds.spad.pile_up import without_pile_up
from camkit.runtime.kinds.spad.pulse import GatedPulse, GaussianPulse
from camkit.runtime.kinds.spad.scatter import growth, growth_of_bins
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way
from camkit.runtime.kinds.spad.time_axis import Orientation, TimeAxis

CYCLES = 400
RATES = 0.03 + 0.4 * np.exp(-0.5 * ((np.arange(60) - 30) / 4) ** 2)


def _seen(rates: np.ndarray, orientation: Orientation, rng: np.random.Generator) -> np.ndarray:
    """Draw what a detector counts that is blind after a photon, (p, bins)."""
    fired = -np.expm1(-rates)
    if orientation == "gate":
        return np.asarray(rng.binomial(CYCLES, fired), np.float32)
    left = np.full(len(rates), CYCLES)
    counts = np.empty_like(rates)
    for k in range(rates.shape[1]):
        counts[:, k] = rng.binomial(left, fired[:, k])
        left = left - counts[:, k].astype(int)
    return np.asarray(counts, np.float32)


@pytest.mark.parametrize("orientation", ["gate", "histogram"])
def test_growth_is_the_variance_of_repeated_captures(orientation: Orientation) -> None:
    rng = np.random.default_rng(2)
    rates = RATES if orientation == "gate" else 0.15 * RATES
    seen = _seen(np.broadcast_to(rates, (20_000, 60)), orientation, rng)
    found = without_pile_up(seen, CYCLES, orientation)
    truth = CYCLES * rates[None].astype(np.float32)
    told = growth_of_bins(truth, CYCLES, orientation)[0]
    bright = np.s_[20:40]
    counts = found.counts[~found.blind, bright].astype(np.float64)
    measured = counts.var(axis=0) / counts.mean(axis=0)
    np.testing.assert_allclose(told[bright], measured, rtol=0.06)
    assert told.max() > 1.2


@pytest.mark.parametrize("orientation", ["gate", "histogram"])
def test_sigma_holds_behind_the_correction(orientation: Orientation) -> None:
    rng = np.random.default_rng(3)
    axis = TimeAxis.regular(orientation, bins=100, time_bin_ps=20)
    gated = GatedPulse(width_ps=200.0, rc_ps=60.0, sigma_ps=40.0)
    pulse = gated if orientation == "gate" else GaussianPulse(sigma_ps=40.0)
    times = rng.uniform(900, 1100, 1500)
    every = np.broadcast_to(np.arange(axis.bins), (len(times), axis.bins))
    shares = axis.shares(pulse, times, every)
    most = 1.5 if orientation == "gate" else 0.25
    seen = _seen(most * (shares / shares.max() + 0.01), orientation, rng)
    undone = without_pile_up(seen, CYCLES, orientation)
    cube = undone.counts.reshape(30, 50, axis.bins)
    sharpener = Sharpener(axis, pulse, Way(pool="1", seek_hot=False))
    grown = growth(sharpener.fitter, undone.counts, CYCLES).reshape(30, 50)
    found = sharpener.strip(cube, growth=grown)
    ratios = np.abs(found.time_of_flight_ps.ravel() - times) / found.sigma_ps.ravel()
    assert 0.93 < np.quantile(ratios[~undone.blind], 0.6827) < 1.07
    plain = sharpener.strip(cube)
    ratios = np.abs(plain.time_of_flight_ps.ravel() - times) / plain.sigma_ps.ravel()
    assert np.quantile(ratios[~undone.blind], 0.6827) > 1.1
    np.testing.assert_allclose(found.intensity, plain.intensity, rtol=1e-5)
    np.testing.assert_allclose(found.amplitude, plain.amplitude, rtol=0.01)


def test_few_photons_of_many_cycles_scatter_as_they_are() -> None:
    counts = np.random.default_rng(0).poisson(3, (4, 30)).astype(np.float32)
    np.testing.assert_allclose(growth_of_bins(counts, 10**9, "histogram"), 1, rtol=1e-6)
