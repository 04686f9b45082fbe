"""Lifetimes reach the Cramer-Rao bound, say how sure they are, and are marked where unknown."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.lifetime.decay import Decay
from camkit.runtime.kinds.spad.lifetime.fitter import LifetimeFitter
from camkit.runtime.kinds.spad.lifetime.guess import guess_width
from camkit.runtime.kinds.spad.pulse import GaussianPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis

AXIS = TimeAxis.regular("histogram", bins=256, time_bin_ps=48.83)
DECAY = Decay(axis=AXIS, pulse=GaussianPulse(sigma_ps=100))
PIXELS = 1500


@pytest.fixture(scope="module")
def fitter() -> LifetimeFitter:
    return LifetimeFitter(DECAY)


def _drawn(
    tau: float, photons: float, even: float, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, float]:
    """Give counts, times of the pulse, and the Cramer-Rao bound by the whole matrix."""
    rng = np.random.default_rng(seed)
    mu = rng.uniform(2400, 2600, PIXELS)
    shapes = DECAY.shapes(mu, np.full(PIXELS, tau))
    mean = photons * shapes.shares + even
    g = np.stack(
        [
            photons * shapes.by_log,
            photons * shapes.by_time,
            shapes.shares,
            np.ones_like(mean),
        ],
        axis=1,
    )
    inverse = np.linalg.inv((g / mean[:, None]) @ g.transpose(0, 2, 1))
    return rng.poisson(mean).astype(np.float32), mu, tau * float(np.sqrt(inverse[:, 0, 0].mean()))


@pytest.mark.parametrize("tau", [400.0, 2500.0])
@pytest.mark.parametrize("even", [0.02, 0.5])
def test_lifetimes_of_a_thousand_photons_reach_the_bound(
    fitter: LifetimeFitter, tau: float, even: float
) -> None:
    counts, mu, bound = _drawn(tau, 1000, even)
    found = fitter.fit(counts)
    assert (found.evidence > fitter.threshold()).all()
    assert found.is_determined.all()
    errors = found.lifetime_ps - tau
    assert np.sqrt(np.mean(errors**2)) < 1.1 * bound
    assert abs(errors.mean()) < 0.2 * bound
    # 0.683 of a normal; four standard errors of 1500 pixels
    assert np.mean(np.abs(errors) < found.sigma_ps) == pytest.approx(0.683, abs=0.05)
    assert np.median(found.amplitude) == pytest.approx(1000, rel=0.02)
    assert np.median(np.abs(found.time_of_flight_ps - mu)) < 20


def test_background_alone_is_no_decay(fitter: LifetimeFitter) -> None:
    for even in (0.05, 1.0, 10.0):
        counts = np.random.default_rng(3).poisson(even, (4000, AXIS.bins)).astype(np.float32)
        found = fitter.fit(counts)
        assert np.mean((found.evidence > fitter.threshold()) & found.is_determined) <= 1e-3


def test_much_background_is_not_read_as_a_slow_decay(fitter: LifetimeFitter) -> None:
    counts, _, bound = _drawn(500, 100, 1.0)
    found = fitter.fit(counts)
    valid = (found.evidence > fitter.threshold()) & found.is_determined
    assert valid.mean() > 0.9
    assert np.sqrt(np.mean((found.lifetime_ps[valid] - 500) ** 2)) < 1.25 * bound


def test_dark_pixels_and_prompt_light_are_not_known(fitter: LifetimeFitter) -> None:
    dark = fitter.fit(np.zeros((3, AXIS.bins), np.float32))
    assert dark.evidence.tolist() == [0, 0, 0]
    assert dark.amplitude.tolist() == [0, 0, 0]
    assert np.isfinite(dark.sigma_ps).all()
    rng = np.random.default_rng(0)
    every = np.broadcast_to(np.arange(AXIS.bins), (50, AXIS.bins))
    prompt = 300 * AXIS.shares(DECAY.pulse, np.full(50, 3000.0), every)
    found = fitter.fit(rng.poisson(prompt).astype(np.float32))
    # light that does not fade has no lifetime: what is found is short, and mostly marked
    assert np.median(found.lifetime_ps) < 60
    assert found.is_determined.mean() < 0.5
    assert fitter.fit(np.zeros((0, AXIS.bins), np.float32)).lifetime_ps.shape == (0,)


def test_many_bins_are_searched_as_few_are() -> None:
    """The bank of starts does not grow with the bins, and fits still reach the bound."""
    import tracemalloc

    fine = TimeAxis.regular("histogram", bins=4096, time_bin_ps=48.83 / 16)
    decay = Decay(axis=fine, pulse=GaussianPulse(sigma_ps=10))
    mean = 2000 * decay.shapes(np.full(40, 2500.0), np.full(40, 900.0)).shares + 0.01
    counts = np.random.default_rng(0).poisson(mean).astype(np.float32)
    tracemalloc.start()
    found = LifetimeFitter(decay).fit(counts)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 200e6
    assert found.is_determined.all()
    assert np.median(found.lifetime_ps) == pytest.approx(900, rel=0.02)
    assert np.sqrt(np.mean((found.lifetime_ps - 900) ** 2)) < 1.4 * np.median(found.sigma_ps)


def test_limits_that_are_none_are_refused() -> None:
    with pytest.raises(ContractError, match="limits of lifetimes must be > 0 and increase"):
        LifetimeFitter(DECAY, (500.0, 100.0))


def test_the_pulse_before_a_decay_is_found() -> None:
    counts, _, _ = _drawn(2500, 300, 0.1)
    shifted = Decay(axis=AXIS, pulse=GaussianPulse(sigma_ps=100))
    mean = 3e5 * shifted.shapes(np.array([2500.0]), np.array([2500.0])).shares + 30
    whole = np.random.default_rng(0).poisson(mean).astype(np.float32)
    assert guess_width(whole, AXIS, None).sigma_ps == pytest.approx(100, rel=0.05)
    with pytest.raises(ContractError, match=r"photons are too few.*state \[laser\] fwhm_ps"):
        guess_width(counts[:2], AXIS, None)
