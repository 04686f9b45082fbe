"""Satellites of known light are found, noise and the star itself are not."""

import numpy as np
import pytest

from camkit.report.satellites import find_stars, satellites
from camkit.scenes.clean import star_field

SKY, LIGHT = 2e-3, 0.8


@pytest.fixture
def truth() -> np.ndarray:
    rng = np.random.default_rng(5)
    return star_field(rng, (200, 240), light=LIGHT, sky=SKY, pitch_px=40)


def _with_spots(truth: np.ndarray, share: float, away_px: int) -> np.ndarray:
    """Put a share of each star's light, and half of it below the sky, beside it."""
    picture = truth.copy()
    for y, x in np.rint(find_stars(truth)).astype(int):
        light = (truth[:, y - 4 : y + 5, x - 4 : x + 5] - truth[:, y - 10, x - 10, None, None]).sum(
            axis=(1, 2)
        )
        picture[:, y, x + away_px] += share * light
        picture[:, y + away_px, x] -= share / 2 * light
    return picture


def test_stars_are_found_where_they_are(truth: np.ndarray) -> None:
    one = np.full((3, 80, 80), SKY, np.float32)
    y, x = np.mgrid[:80, :80]
    one += np.exp(-((y - 40.3) ** 2 + (x - 33.8) ** 2) / 0.5).astype(np.float32)
    np.testing.assert_allclose(find_stars(one), [[40.3, 33.8]], atol=0.03)
    assert len(find_stars(np.pad(truth, ((0, 0), (20, 20), (20, 20)), mode="edge"))) == 5 * 6
    assert not len(find_stars(truth[:, :30, :30]))


def test_the_truth_has_no_satellites(truth: np.ndarray) -> None:
    found = satellites(truth, truth)
    assert found.above.max() < 0.03
    assert found.below.max() < 1e-6
    np.testing.assert_allclose(found.core + found.above, 1, atol=1e-4)


@pytest.mark.parametrize("away_px", [5, 10])
def test_satellites_are_counted_in_shares_of_their_star(truth: np.ndarray, away_px: int) -> None:
    own = satellites(truth, truth).above
    found = satellites(_with_spots(truth, 0.2, away_px), truth)
    np.testing.assert_allclose(found.above - own, 0.2, atol=2e-3)
    np.testing.assert_allclose(found.below, 0.1, atol=2e-3)
    np.testing.assert_allclose(found.core, satellites(truth, truth).core, atol=2e-3)


def test_what_lies_beyond_the_ring_belongs_to_no_star(truth: np.ndarray) -> None:
    own = satellites(truth, truth).above
    np.testing.assert_allclose(satellites(_with_spots(truth, 0.2, 18), truth).above, own, atol=1e-4)


def test_a_brighter_sky_and_noise_add_nothing(truth: np.ndarray) -> None:
    spots = _with_spots(truth, 0.2, 7)
    noise = np.random.default_rng(1).normal(0, 1e-3, truth.shape)
    found = satellites((spots + 0.05 + noise).astype(np.float32), truth)
    assert np.median(found.above) == pytest.approx(0.2, abs=0.03)
    assert np.median(found.below) == pytest.approx(0.1, abs=0.03)
