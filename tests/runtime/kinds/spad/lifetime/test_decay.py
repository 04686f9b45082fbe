"""A decay behind a pulse is the convolution of the two, folded where the laser fires again."""

import numpy as np
import pytest

from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.kinds.spad.lifetime.decay import Decay
from camkit.runtime.kinds.spad.pulse import GatedPulse, GaussianPulse, Pulse, SampledPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis

AXIS = TimeAxis.regular("histogram", bins=100, time_bin_ps=100)
TIMES = np.arange(-400.0, 401.0, 40.0)
PULSES = {
    "gaussian": GaussianPulse(sigma_ps=80),
    "measured": SampledPulse(times_ps=TIMES, values=np.exp(-0.5 * ((TIMES + 50) / 90) ** 2)),
}


def _slow_twin(pulse: Pulse, mu: float, tau: float, period: float | None) -> np.ndarray:
    """Integrate the convolution numerically: the pulse's distribution at every delay of a decay."""
    delays = (np.arange(40_000) + 0.5) * tau * 25 / 40_000
    weights = np.exp(-delays / tau)
    weights /= weights.sum()
    turns = range(6) if period is not None else (0,)
    seen = np.zeros(AXIS.bins + 1)
    for i, edge in enumerate(AXIS.edges_ps):
        for turn in turns:
            u = edge - mu + turn * (period or 0.0) - delays
            seen[i] += weights @ pulse.cdf(u)
    return np.diff(seen)


@pytest.mark.parametrize("name", PULSES)
@pytest.mark.parametrize("tau", [120.0, 1500.0])
@pytest.mark.parametrize("period", [None, 10_000.0])
def test_shares_are_the_convolution_written_out(
    name: str, tau: float, period: float | None
) -> None:
    pulse = PULSES[name]
    decay = Decay(axis=AXIS, pulse=pulse, period_ps=period)
    found = decay.shapes(np.array([2345.0]), np.array([tau])).shares[0]
    np.testing.assert_allclose(found, _slow_twin(pulse, 2345.0, tau, period), atol=2e-6)


@pytest.mark.parametrize("name", PULSES)
@pytest.mark.parametrize("period", [None, 10_000.0])
def test_slopes_are_differences_of_shares(name: str, period: float | None) -> None:
    decay = Decay(axis=AXIS, pulse=PULSES[name], period_ps=period)
    mu, tau = np.array([2345.0, 3000.0]), np.array([150.0, 2500.0])
    shapes = decay.shapes(mu, tau)
    by_time = (decay.shapes(mu + 0.1, tau).shares - decay.shapes(mu - 0.1, tau).shares) / 0.2
    ahead, behind = (decay.shapes(mu, tau * np.exp(h)).shares for h in (1e-4, -1e-4))
    np.testing.assert_allclose(shapes.by_time, by_time, atol=2e-7)
    np.testing.assert_allclose(shapes.by_log, (ahead - behind) / 2e-4, atol=2e-5)


def test_a_whole_period_holds_every_photon() -> None:
    decay = Decay(axis=AXIS, pulse=PULSES["gaussian"], period_ps=10_000.0)
    found = decay.shapes(np.array([4000.0]), np.array([9000.0]))
    assert found.shares.sum() == pytest.approx(1.0, abs=1e-9)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ContractError, match=r"period_ps = 5000 is shorter than the 10000 ps"):
        Decay(axis=AXIS, pulse=PULSES["gaussian"], period_ps=5000.0)
    gate = TimeAxis.regular("gate", bins=100, time_bin_ps=100)
    with pytest.raises(UnsupportedError, match="not to scans with a gate"):
        Decay(axis=gate, pulse=PULSES["gaussian"])
    with pytest.raises(UnsupportedError, match="not to scans with a gate"):
        Decay(axis=AXIS, pulse=GatedPulse(width_ps=200, rc_ps=60, sigma_ps=40))
