"""Orders against closed forms of gratings."""

import numpy as np
import pytest

from camkit.models_def.optics.dots.orders import intensity, order_matrix, orders_of

CELLS = 24


def _light(phase: np.ndarray, orders: int = 11) -> np.ndarray:
    return intensity(orders_of(np.exp(1j * phase), order_matrix(phase.shape[0], orders)))


def test_a_flat_plate_leaves_all_light_straight_on() -> None:
    expected = np.zeros((11, 11))
    expected[5, 5] = 1
    np.testing.assert_allclose(_light(np.full((CELLS, CELLS), 0.7)), expected, atol=1e-15)


def test_a_binary_grating_of_half_a_cycle_has_its_known_orders() -> None:
    phase = np.pi * (np.arange(CELLS) >= CELLS // 2) * np.ones((CELLS, 1))
    line = _light(phase)[5]
    for order in (1, 3, 5):
        known = (2 / (np.pi * order)) ** 2
        assert line[5 + order] == pytest.approx(known)
        assert line[5 - order] == pytest.approx(known)
    np.testing.assert_allclose(line[[5, 7, 3, 9, 1]], 0, atol=1e-15)


@pytest.mark.parametrize("levels", [2, 4, 8])
def test_a_blazed_grating_of_n_levels_has_sinc_squared_of_one_by_n(levels: int) -> None:
    step = 2 * np.pi / levels
    phase = step * (np.arange(CELLS) * levels // CELLS)[:, None] * np.ones(CELLS)
    light = _light(phase)
    assert light[6, 5] == pytest.approx(np.sinc(1 / levels) ** 2)
    # rows of the plate turn light along rows of the picture
    assert light[:, [4, 6]].max() < 1e-15


def test_all_orders_together_hold_all_light() -> None:
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, (12, 12))
    held = _light(phase, 1201).sum()
    # what is missing lies beyond order 600 of either axis: 2 x 2 / (pi^2 600 / 12), at most
    assert 1 - 4 * 12 / (np.pi**2 * 600) < held < 1


def test_rolling_a_unit_moves_no_light() -> None:
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, (CELLS, CELLS))
    np.testing.assert_allclose(_light(np.roll(phase, (5, 7), (0, 1))), _light(phase), atol=1e-15)
