"""What steps of a converter leave of noise: known noise is found, or said to lie below a bound."""

import numpy as np
import pytest

from camkit.calibration.noise.rounding import LEAST_BOUND, rounded_variance, spread_of

READ_NOISE_TOLERANCE = 0.05
MANY = 10**9


@pytest.mark.parametrize("place", [0.0, 0.2, 0.5])
def test_wide_noise_gains_a_twelfth_of_a_squared_step(place: float) -> None:
    assert rounded_variance(1.0, place) == pytest.approx(1 + 1 / 12, abs=1e-6)


@pytest.mark.parametrize("place", [0.0, 0.3, 0.5])
def test_the_formula_says_what_rounded_samples_show(place: float) -> None:
    samples = np.rint(place + 0.3 * np.random.default_rng(0).standard_normal(10**6))
    assert samples.var() == pytest.approx(rounded_variance(0.3, place), rel=0.01)


@pytest.mark.parametrize("sigma", np.arange(0.05, 1.4, 0.05))
@pytest.mark.parametrize("place", np.arange(0, 0.55, 0.1))
@pytest.mark.parametrize("step", [1.0, 4.0])
def test_noise_is_found_to_5_percent_or_lies_below_what_is_said(
    sigma: float, place: float, step: float
) -> None:
    found = spread_of(step**2 * rounded_variance(sigma, place), MANY, step)
    if found.resolved:
        assert found.value == pytest.approx(sigma * step, rel=READ_NOISE_TOLERANCE)
    else:
        assert found.value >= sigma * step
        assert found.value >= LEAST_BOUND * step
    if sigma > 0.5:
        assert found.resolved


def test_a_dark_without_any_noise_has_a_bound_and_not_zero() -> None:
    found = spread_of(0.0, 1000, 1.0)
    assert (found.value, found.resolved) == (LEAST_BOUND, False)
