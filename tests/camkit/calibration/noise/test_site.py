"""Differences of pairs tell the noise in time, products the fixed pattern."""

import numpy as np
import pytest

from camkit.calibration.noise.site import site_pair

SIDE = 512
RELATIVE = 0.02  # the spread of a variance of 262,144 samples is 0.3 %


def _rng() -> np.random.Generator:
    return np.random.default_rng(4)


def test_noise_and_pattern_come_apart() -> None:
    rng = _rng()
    pattern = 3 * rng.standard_normal((SIDE, SIDE))
    first, second = (100 + pattern + 2 * rng.standard_normal((SIDE, SIDE)) for _ in range(2))
    found = site_pair(first, second, None, 1.0)
    assert found.variance == pytest.approx(4, rel=RELATIVE)
    assert found.pattern == pytest.approx(9, rel=RELATIVE)
    assert found.mean == pytest.approx(100, abs=0.1)
    assert found.defects == 0


@pytest.mark.parametrize("ratio", [0.92, 1.0, 1.06])
def test_a_lamp_that_drifts_moves_no_point_off_the_line(ratio: float) -> None:
    rng = _rng()
    light = 2000 * (1 + 0.02 * rng.standard_normal((SIDE, SIDE)))
    first, second = (rng.poisson(light * f) / 4 + 7 for f in (1.0, ratio))
    found = site_pair(first, second, 7.0, 1.0)
    assert found.variance == pytest.approx(found.signal / 4, rel=RELATIVE)
    # 2 % of the light of the first frame, which the second was brought to
    assert np.sqrt(found.pattern) == pytest.approx(0.02 * found.lit, rel=RELATIVE)
    assert found.lit == pytest.approx(500, rel=1e-3)


def test_uneven_light_is_no_pattern() -> None:
    rng = _rng()
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE - 0.5
    light = 2000 * (1 - y**2 - x**2 + 0.3 * x)
    first, second = (rng.poisson(light).astype(np.float64) for _ in range(2))
    found = site_pair(first, second, 0.0, 1.0)
    assert found.variance == pytest.approx(found.signal, rel=RELATIVE)
    assert np.sqrt(max(found.pattern, 0)) < 0.005 * found.signal


def test_hot_pixels_are_left_out_and_counted() -> None:
    rng = _rng()
    first, second = (rng.standard_normal((SIDE, SIDE)) for _ in range(2))
    places = rng.choice(SIDE**2, 40, replace=False)
    first.reshape(-1)[places] += 900
    second.reshape(-1)[places[:20]] += 700
    found = site_pair(first, second, None, 1.0)
    assert found.defects == 40
    assert found.variance == pytest.approx(1, rel=RELATIVE)
    assert abs(found.pattern) < 0.02


def test_a_side_that_no_block_fills_is_left_out() -> None:
    first, second = (_rng().standard_normal((37, 70)) for _ in range(2))
    assert site_pair(first, second, None, 1.0).samples < 32 * 64
