"""The search for a blur's parameter: on errors that are known."""

import numpy as np
import pytest

from camkit.calibration.blur_pair.blur_errors import BlurErrors, gain_db
from camkit.calibration.blur_pair.blur_search import MOST_STEPS, search

IS_EVEN = np.arange(16) % 2 == 0


def _errors(value: float, best: np.ndarray) -> BlurErrors:
    """Return errors that are parabolas about a best of each block."""
    sums = 1.0 + np.square(value - best)
    return BlurErrors(
        sums=np.broadcast_to(sums[:, None, None], (16, 3, 3)).copy(), counts=np.ones((16, 3, 3))
    )


def test_each_half_finds_its_own_best_and_is_judged_by_the_others() -> None:
    best = np.where(IS_EVEN, 2.1, 2.5)
    result = search(lambda value: _errors(value, best), 0.0, 0.5, IS_EVEN)
    assert result.best == pytest.approx(2.3)
    assert result.halves == pytest.approx((2.1, 2.5))
    assert result.colours == pytest.approx((2.3, 2.3, 2.3))
    assert result.error == pytest.approx(0.2)
    assert result.is_bracketed
    np.testing.assert_allclose(result.errors.sums, 1 + 0.4**2)
    np.testing.assert_allclose(result.start.sums[0], 1 + 2.1**2)


def test_a_search_without_an_end_says_so() -> None:
    result = search(lambda value: _errors(value, np.full(16, 1e3)), 0.0, 1.0, IS_EVEN)
    assert not result.is_bracketed
    assert result.best >= MOST_STEPS - 1


def test_a_gain_has_the_error_of_the_jackknife() -> None:
    rng = np.random.default_rng(0)
    sums = rng.uniform(1, 2, (16, 3, 3))
    ours, theirs = (BlurErrors(sums=s, counts=np.ones((16, 3, 3))) for s in (sums, 1.1 * sums))
    gain, error = gain_db(ours, theirs)
    assert gain == pytest.approx(10 * np.log10(1.1))
    assert error == pytest.approx(0, abs=1e-9)
    other = BlurErrors(sums=sums * rng.uniform(1, 1.2, (16, 1, 1)), counts=ours.counts)
    gain, error = gain_db(ours, other)
    assert 0.02 < error < gain
    assert ours.psnr_db(zone=0, colour=1) == pytest.approx(-10 * np.log10(sums[:, 0, 1].mean()))
