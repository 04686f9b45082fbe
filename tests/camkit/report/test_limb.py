"""Wobble, seam and rim of drawn limbs are what was drawn."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.report.limb import (
    LONGEST_PX,
    SAMPLED_PX,
    crossings,
    find_limb,
    largest_rise,
    limb_errors,
    wobble,
)

SIDE_PX, RADIUS_PX = 240, 70.0
SKY, LEVEL = 0.001, 0.5


def _disc(
    ripple_px: float = 0.0, waves: int = 0, seam: float = 0.0, rim: float = 0.0, aside_px: float = 0
) -> np.ndarray:
    """Draw a disc whose radius ripples, between a dark ring in a haze and a bright rim."""
    y, x = np.mgrid[:SIDE_PX, :SIDE_PX] - 119.6
    x = x - aside_px
    limb = RADIUS_PX + ripple_px * np.cos(waves * np.arctan2(y, x))
    away = np.hypot(y, x) - limb
    scene = SKY + (LEVEL - SKY) * np.clip(0.5 - away, 0, 1)
    # dark just outside, then haze: the picture rises again by the seam
    scene += (LEVEL - SKY) * seam * np.clip((away - 3) / 2, 0, 1)
    scene += (LEVEL - SKY) * rim * np.exp(-((away + 8) ** 2) / 8)
    return np.stack([scene] * 3).astype(np.float32)


def test_the_truth_is_even() -> None:
    found = limb_errors(_disc(), _disc())
    assert found.wobble_px == 0
    assert max(found.seam, found.rim) < 1e-3


@pytest.mark.parametrize(("ripple_px", "waves"), [(0.3, 12), (0.5, 20), (1.0, 30)])
def test_a_ripple_is_a_wobble_of_its_effective_value(ripple_px: float, waves: int) -> None:
    found = limb_errors(_disc(ripple_px, waves), _disc())
    frequency = waves / (2 * np.pi * RADIUS_PX)
    passed = np.exp(-2 * (np.pi * SAMPLED_PX * frequency) ** 2)  # Gaussian, in closed form
    assert found.wobble_px == pytest.approx(passed * ripple_px / np.sqrt(2), rel=0.03)


def test_a_disc_that_is_oval_or_aside_does_not_wobble() -> None:
    truth = _disc()
    still = limb_errors(_disc(aside_px=0.4), truth).wobble_px
    assert max(still, limb_errors(_disc(0.5, 2), truth).wobble_px) < 0.05


def test_what_the_truth_ripples_is_taken_off() -> None:
    assert limb_errors(_disc(0.5, 20), _disc(0.5, 20)).wobble_px == 0


def test_seam_and_rim_are_shares_of_the_step() -> None:
    found = limb_errors(_disc(seam=0.04, rim=0.1), _disc())
    assert found.seam == pytest.approx(0.04, rel=0.02)
    assert found.rim == pytest.approx(0.1, rel=0.05)
    blurred = limb_errors(_blurred(_disc()), _disc())
    assert max(blurred.seam, blurred.rim) < 1e-3


def _blurred(picture: np.ndarray) -> np.ndarray:
    from scipy.ndimage import gaussian_filter

    return gaussian_filter(picture, (0, 3, 3)).astype(np.float32)


def test_a_limb_is_found_though_it_is_oval() -> None:
    limb = find_limb(_disc(4.0, 2))
    assert limb.radius_px.max() == pytest.approx(74, abs=0.3)
    assert limb.radius_px.min() == pytest.approx(66, abs=0.3)


def test_a_disc_without_room_is_refused() -> None:
    with pytest.raises(ContractError, match="expected a disc of more than 24 px radius"):
        find_limb(_disc()[:, 40:, :])


def test_profiles_that_never_fall_are_left_out() -> None:
    away = np.arange(-2.0, 3.0)
    at = crossings(np.array([[1, 1, 1, 0, 0], [1, 1, 1, 1, 1.0]]), away, 0.5)
    assert at[0] == pytest.approx(0.5)
    assert np.isnan(at[1])
    assert np.isnan(wobble(np.full(64, np.nan), 10.0))
    even = np.where(np.arange(400) == 7, np.nan, 0.3)
    assert wobble(even, 400 / (2 * np.pi)) == pytest.approx(0)
    radius_px = 4 * LONGEST_PX / (2 * np.pi)
    for waves, seen in ((3, 0.0), (5, np.sqrt(0.5))):
        moved = np.cos(2 * np.pi * waves * np.arange(400) / 400)
        assert wobble(moved, radius_px) == pytest.approx(seen, abs=1e-9)


def test_the_largest_rise_is_from_any_place_to_a_later_one() -> None:
    rises = largest_rise(np.array([[3.0, 1, 2, 4, 0], [3, 2, 1, 1, 0]]))
    np.testing.assert_allclose(rises, [3, 0])
