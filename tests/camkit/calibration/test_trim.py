import numpy as np
import pytest

from camkit.calibration.trim import LEAST_HALF_PX, cropped, reach_px, smooth_noise


def _noisy(streak: float) -> tuple[np.ndarray, np.ndarray]:
    """Give light with a streak along a row to 50 px and noise 1, and what it is without noise."""
    light = np.zeros((201, 201))
    light[100, 50:151] = streak
    light[98:103, 98:103] = 1e4
    return light + np.random.default_rng(0).normal(size=light.shape), light


@pytest.mark.parametrize(("streak", "reach"), [(20.0, 52), (0.0, 2 + 2 + 3)])
def test_the_crop_ends_where_light_leaves_the_noise(streak: float, reach: int) -> None:
    noisy, _ = _noisy(streak)
    found = reach_px(noisy[None], np.ones((1, 201, 201)))
    assert abs(found - max(reach, LEAST_HALF_PX)) <= 3
    assert cropped(noisy, found).shape == (2 * found + 1,) * 2
    assert cropped(noisy, found)[found, found] == noisy[100, 100]


def test_a_second_light_far_away_does_not_widen_the_crop() -> None:
    noisy, _ = _noisy(20.0)
    noisy[10:14, 10:14] += 500
    assert reach_px(noisy[None], np.ones((1, 201, 201))) < 60


def test_noise_is_smoothed_and_light_kept() -> None:
    noisy, light = _noisy(20.0)
    found = smooth_noise(noisy, np.ones(noisy.shape))
    dark = (slice(120, 190), slice(10, 190))
    assert found[dark].std() < 0.35 * noisy[dark].std()
    assert np.maximum(found, 0)[dark].mean() < 0.35 * np.maximum(noisy, 0)[dark].mean()
    assert found[100, 55:90].mean() == pytest.approx(20, rel=0.03)
    assert np.abs(found - light)[98:103, 98:103].max() < 5
