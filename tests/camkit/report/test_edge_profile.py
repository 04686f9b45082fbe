"""Profiles across edges: bins, and the spectrum of what is known."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.report.edge_profile import edge_waves, sort_samples

REACH_PX = 16


def slanted_distances(rows: int = 64, slope: float = 0.0618) -> np.ndarray:
    y, x = np.mgrid[:rows, : 3 * REACH_PX]
    return np.asarray(x - 1.5 * REACH_PX + slope * (y - rows / 2), np.float64)


def test_a_profile_is_the_mean_of_the_samples_of_a_bin() -> None:
    far = slanted_distances()
    bins = sort_samples(far, REACH_PX)
    assert bins.counts.size == 2 * REACH_PX * 4
    assert bins.counts.sum() == bins.inside.sum() == bins.number.size
    # the distance itself is its own profile
    np.testing.assert_allclose(bins.means(far), bins.places)
    assert np.abs(bins.places - (np.arange(128) - 63.5) / 4).max() < 0.125


def test_the_spectrum_of_a_step_is_flat_and_that_of_a_plane_nearly_nothing() -> None:
    far = slanted_distances()
    bins = sort_samples(far, REACH_PX)
    waves = edge_waves(bins, np.array([0.0, 0.2, 0.4]))
    assert np.abs(waves @ np.ones(bins.counts.size)).max() < 1e-9
    soft = np.clip(far / 0.25 + 0.5, 0, 1)
    expected = np.sinc(0.25 * np.array([0.0, 0.2, 0.4]))
    np.testing.assert_allclose(np.abs(waves @ bins.means(soft)), expected, atol=0.01)


def test_positions_that_no_sample_shows_are_told_with_their_gap() -> None:
    with pytest.raises(ContractError, match=r"gaps of up to 1 px"):
        sort_samples(slanted_distances(slope=0.0), REACH_PX)
    with pytest.raises(ContractError, match=r"gaps of up to 0\.25 px"):
        sort_samples(slanted_distances(slope=0.25), REACH_PX)
