"""Pulses in closed form agree with brute force."""

import numpy as np
import pytest
from scipy.integrate import quad

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.pulse import GatedPulse, GaussianPulse, Pulse, SampledPulse

GRID = np.linspace(-400, 1500, 200_001)
TRIANGLE = SampledPulse(
    times_ps=np.array([-100.0, 0.0, 50.0, 400.0]), values=np.array([0.0, 3.0, 1.0, 0.0])
)
PULSES: list[Pulse] = [
    GaussianPulse(sigma_ps=30),
    GatedPulse(width_ps=200, rc_ps=60, sigma_ps=42.5),
    GatedPulse(width_ps=200, rc_ps=0, sigma_ps=20),
    GatedPulse(width_ps=150, rc_ps=40, sigma_ps=0),
    GatedPulse(width_ps=100, rc_ps=2, sigma_ps=50),
    TRIANGLE,
]


@pytest.mark.parametrize("pulse", PULSES)
def test_density_integrates_to_one_and_to_the_distribution(pulse: Pulse) -> None:
    density = pulse.density(GRID)
    assert (density >= 0).all()
    sums = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(GRID))])
    assert sums[-1] == pytest.approx(1, abs=2e-5)
    np.testing.assert_allclose(pulse.cdf(GRID), sums, atol=1e-4)


@pytest.mark.parametrize("pulse", PULSES)
def test_mean_and_support_are_those_of_the_density(pulse: Pulse) -> None:
    density = pulse.density(GRID)
    assert pulse.mean_ps == pytest.approx(np.trapezoid(density * GRID, GRID), abs=0.05)
    outside = pulse.cdf(np.array([pulse.start_ps])) + 1 - pulse.cdf(np.array([pulse.end_ps]))
    assert outside[0] < 2e-6


def test_gate_is_the_convolution_that_the_manual_states() -> None:
    pulse = GatedPulse(width_ps=200, rc_ps=60, sigma_ps=42.5)

    def edge(u: float) -> float:
        return 1 - np.exp(-u / 60) if u > 0 else 0.0

    def seen(u: float) -> float:
        def inner(x: float) -> float:
            gauss = np.exp(-0.5 * (x / 42.5) ** 2) / (42.5 * np.sqrt(2 * np.pi))
            return float((edge(u - x) - edge(u - x - 200)) * gauss)

        return float(quad(inner, -255, 255, points=sorted({min(max(u, -254), 254)}), limit=200)[0])

    for u in (-60.0, 0.0, 80.0, 200.0, 330.0, 600.0):
        found = pulse.density(np.array([u]))[0] * pulse.height_ps
        assert found == pytest.approx(seen(u), abs=2e-5)


def test_edges_stay_finite_far_from_the_pulse() -> None:
    pulse = GatedPulse(width_ps=200, rc_ps=1, sigma_ps=80)
    far = np.array([-1e9, -1e4, 1e4, 1e9])
    assert pulse.density(far).tolist() == [0, 0, 0, 0]
    np.testing.assert_allclose(pulse.cdf(far), [0, 0, 1, 1], atol=1e-7)


@pytest.mark.parametrize(("sigma", "expected"), [(20.0, 20.0), (80.0, 80.0)])
def test_measured_gaussian_has_the_edge_of_the_formula(sigma: float, expected: float) -> None:
    times = np.linspace(-6 * sigma, 6 * sigma, 2001)
    sampled = SampledPulse(times_ps=times, values=GaussianPulse(sigma_ps=sigma).density(times))
    assert sampled.finest_ps == pytest.approx(expected, rel=1e-3)
    assert sampled.height_ps == pytest.approx(sigma * np.sqrt(2 * np.pi), rel=1e-3)


@pytest.mark.parametrize("width", [0.0, -1.0, np.nan, np.inf])
def test_pulses_without_a_width_are_refused(width: float) -> None:
    with pytest.raises(ContractError, match="width > 0"):
        GaussianPulse(sigma_ps=width)
    with pytest.raises(ContractError, match="width > 0"):
        GatedPulse(width_ps=width, rc_ps=1, sigma_ps=1)


def test_other_impossible_pulses_are_refused() -> None:
    with pytest.raises(ContractError, match="time constant"):
        GatedPulse(width_ps=1, rc_ps=-1, sigma_ps=1)
    with pytest.raises(ContractError, match="jitter"):
        GatedPulse(width_ps=1, rc_ps=1, sigma_ps=np.nan)
    times = np.arange(4.0)
    for t, v, message in (
        (times[:2], times[:2], "at least 3 times"),
        (times, times * np.nan, "finite"),
        (times[::-1], times, "increasing"),
        (times, times * 0, "not all 0"),
    ):
        with pytest.raises(ContractError, match=message):
            SampledPulse(times_ps=t, values=v)
