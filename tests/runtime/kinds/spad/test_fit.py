"""Fits reach the Cramer-Rao bound, say how sure they are, and agree with a slow search."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.bank import Bank, Scorer, make_bank
from camkit.runtime.kinds.spad.bound import information
from camkit.runtime.kinds.spad.evidence import (
    false_alarm_rate,
    search_length,
    threshold_for,
)
from camkit.runtime.kinds.spad.fit import Fitter, summed_from_left
from camkit.runtime.kinds.spad.pulse import GatedPulse, GaussianPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis

PIXELS = 4000


@pytest.fixture(scope="module")
def bank(axis: TimeAxis, pulse: GatedPulse) -> Bank:
    return make_bank(axis, pulse)


@pytest.fixture(scope="module")
def fitter(bank: Bank) -> Fitter:
    return Fitter(bank)


def _times(count: int = PIXELS) -> np.ndarray:
    return np.random.default_rng(5).uniform(700, 2000, count)


def test_scores_are_the_likelihood_written_out(bank: Bank, axis: TimeAxis, draw) -> None:  # type: ignore[no-untyped-def]
    counts = draw(axis, np.array([900.0, 1500.0]), 40, 0.2)
    bins = np.arange(axis.bins)[None]
    for ratio in (0.002, 0.5):
        found = Scorer(bank, ratio, every=2).score(counts, counts.sum(1))
        for column, mu in enumerate(bank.mu_ps[::2]):
            shares = axis.shares(bank.pulse, np.array([mu]), bins)[0]
            mean = shares + ratio
            expected = counts @ np.log(mean / mean.sum())
            # the band leaves out shares below a millionth of the pulse
            np.testing.assert_allclose(found[:, column], expected, rtol=2e-4, atol=0.05)


@pytest.mark.parametrize(
    ("photons", "ratio_to_signal", "most"),
    [(1000, 0.1, 1.04), (100, 1.0, 1.05), (100, 1e9, 1.05), (50, 1.0, 1.06), (1000, 10.0, 1.05)],
)
def test_errors_reach_the_bound(  # type: ignore[no-untyped-def]
    photons: float, ratio_to_signal: float, most: float, fitter: Fitter, axis: TimeAxis, draw
) -> None:
    even = photons / ratio_to_signal / axis.bins
    times = _times()
    found = fitter.fit(draw(axis, times, photons, even, seed=1))
    errors = found.time_of_flight_ps - times
    j = information(fitter.bank, max(even / photons, 1e-6))
    at = np.interp(times, fitter.bank.mu_ps, j)
    bound = float(np.sqrt(np.mean(1 / (photons * at))))
    assert np.abs(errors).max() < 400
    assert np.sqrt(np.mean(errors**2)) / bound < most
    assert abs(errors.mean()) < 4 * errors.std() / np.sqrt(PIXELS) + 0.05 * bound
    # 0.683 of a normal; four standard errors of 4000 pixels, and what the table leaves
    assert np.mean(np.abs(errors) < found.sigma_ps) == pytest.approx(0.683, abs=0.045)
    assert np.median(found.amplitude) == pytest.approx(photons, rel=0.05)


def test_both_orientations_find_the_same_time(pulse: GatedPulse, draw) -> None:  # type: ignore[no-untyped-def]
    for name in ("gate", "histogram"):
        axis = TimeAxis.regular(name, bins=125, time_bin_ps=20, first_ps=300)  # type: ignore[arg-type]
        times = np.array([1400.0, 1543.2])
        found = Fitter(make_bank(axis, pulse)).fit(draw(axis, times, 1e6))
        np.testing.assert_allclose(found.time_of_flight_ps, times, atol=0.5)


def test_background_alone_is_believed_no_more_often_than_stated(  # type: ignore[no-untyped-def]
    fitter: Fitter, axis: TimeAxis, draw
) -> None:
    length = search_length(fitter.bank)
    threshold = threshold_for(1e-3, length)
    for even in (0.02, 0.2, 2.0, 50.0):
        counts = np.random.default_rng(3).poisson(even, (100_000, axis.bins))
        found = fitter.fit(counts.astype(np.float32))
        assert np.mean(found.evidence > threshold) <= 1e-3
    found = fitter.fit(draw(axis, _times(), 60.0, 0.1))
    assert (found.evidence > threshold).all()


def test_much_background_costs_no_evidence(fitter: Fitter, axis: TimeAxis, draw) -> None:  # type: ignore[no-untyped-def]
    counts = draw(axis, _times(), 100.0, 100 / 0.03 / axis.bins)
    threshold = threshold_for(1e-3, fitter.search_length)
    # the nearest ratio of the table alone believes 30 % of these
    assert np.mean(fitter.fit(counts).evidence > threshold) > 0.6


def test_threshold_and_rate_are_inverse() -> None:
    for rate in (1e-6, 1e-3, 0.2):
        assert false_alarm_rate(threshold_for(rate, 30.0), 30.0) == pytest.approx(rate)
    assert threshold_for(0.4999, 0.0) < 1e-3
    for rate in (0.0, 0.5, 0.9, np.nan):
        with pytest.raises(ContractError, match=r"must lie in 0\.\.0\.5"):
            threshold_for(rate, 30.0)


def test_an_empty_pixel_has_no_evidence(fitter: Fitter, axis: TimeAxis) -> None:
    found = fitter.fit(np.zeros((3, axis.bins), np.float32))
    assert found.evidence.tolist() == [0, 0, 0]
    assert found.amplitude.tolist() == [0, 0, 0]
    assert np.isfinite(found.sigma_ps).all()


def test_a_pulse_within_a_bin_lies_anywhere_in_it() -> None:
    axis = TimeAxis.regular("histogram", bins=40, time_bin_ps=100)
    pulse = GaussianPulse(sigma_ps=2)
    times = np.random.default_rng(2).uniform(500, 3000, 2000)
    counts = axis.shares(pulse, times, np.broadcast_to(np.arange(40), (2000, 40))) * 50
    found = Fitter(make_bank(axis, pulse)).fit(counts.astype(np.float32))
    errors = found.time_of_flight_ps - times
    assert np.abs(errors).max() < 55
    assert np.mean(np.abs(errors) < found.sigma_ps) > 0.5


def test_bound_is_that_of_the_whole_matrix(bank: Bank, axis: TimeAxis) -> None:
    ratio, m = 0.02, len(bank.mu_ps) // 2
    bins = np.arange(axis.bins)[None]
    mu = bank.mu_ps[m : m + 1]
    s = axis.shares(bank.pulse, mu, bins)[0]
    g = np.stack([axis.slopes(bank.pulse, mu, bins)[0], s, np.ones(axis.bins)])
    inverse = np.linalg.inv(g / (s + ratio) @ g.T)
    assert information(bank, ratio)[m] == pytest.approx(1 / inverse[0, 0], rel=1e-4)


def test_banks_that_nobody_can_hold_are_refused() -> None:
    axis = TimeAxis.regular("gate", bins=1_000_000, time_bin_ps=100)
    with pytest.raises(ContractError, match="templates; at most"):
        make_bank(axis, GatedPulse(width_ps=1000, rc_ps=60, sigma_ps=1))


def test_counts_before_each_bin_are_summed_one_by_one_in_double_precision() -> None:
    counts = np.random.default_rng(5).random((7, 30)).astype(np.float32) * 1e4
    sums = summed_from_left(counts)
    assert (sums[:, 0] == 0).all()
    assert np.array_equal(sums[:, 1:], np.cumsum(counts, axis=1, dtype=np.float64))
