import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.dots.target import likeness, to_target

RAMP = np.arange(121, dtype=np.float64).reshape(11, 11)


@pytest.mark.parametrize("scale", [1.0, 1e-300, 1e306])
def test_any_sum_becomes_one(scale: float) -> None:
    target = to_target(RAMP * scale)
    assert target.sum() == pytest.approx(1)
    np.testing.assert_allclose(target, RAMP / RAMP.sum(), rtol=1e-12)


def test_counts_are_a_psf_too() -> None:
    assert to_target(RAMP.astype(np.uint16)).sum() == pytest.approx(1)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (RAMP[:10], r"11x11 real numbers; got float64 \(10, 11\)"),
        (RAMP + 0j, "real numbers; got complex128"),
        (RAMP.astype(str), "real numbers"),
        (RAMP - 1, "least value is -1"),
        (np.where(RAMP == 3, np.nan, RAMP), "must be finite"),
        (np.where(RAMP == 3, np.inf, RAMP), "must be finite"),
        (RAMP * 0, "needs light"),
    ],
)
def test_what_is_no_light_is_refused(values: np.ndarray, told: str) -> None:
    with pytest.raises(ContractError, match=told):
        to_target(values)


def test_half_the_light_in_the_same_places_is_wholly_alike() -> None:
    target = to_target(RAMP)
    found = likeness(target / 2, target)
    assert found.correlation == pytest.approx(1)
    assert found.rmse == pytest.approx(0, abs=1e-15)
    assert found.efficiency == pytest.approx(0.5)


def test_one_dot_that_is_wrong_by_a_tenth_of_the_peak_is_an_rmse_of_a_hundred_and_tenth() -> None:
    target = to_target(RAMP)
    light = target.copy()
    light[5, 5] += 0.1 * target.max()
    assert likeness(light, target).rmse == pytest.approx(0.1 / 11)


def test_even_light_is_like_even_light_alone() -> None:
    even = np.full((11, 11), 1 / 121)
    assert likeness(even, even).correlation == 1
    assert likeness(even, to_target(RAMP)).correlation == 0
