import numpy as np
import pytest

from camkit.models_def.kinds.spad.sampling import gaussian_psf
from camkit.models_def.optics.dots.gerchberg_saxton import gerchberg_saxton
from camkit.models_def.optics.dots.levels import descend, level_field, rounded, shifted_orders
from camkit.models_def.optics.dots.merit import Merit
from camkit.models_def.optics.dots.orders import intensity, order_matrix, orders_of
from camkit.models_def.optics.dots.target import to_target

MERIT = Merit(target=to_target(gaussian_psf(1.84)))
CELLS, LEVELS = 14, 4
MATRIX = order_matrix(CELLS)


def _merit(level: np.ndarray, levels: int = LEVELS) -> float:
    return float(MERIT.of(intensity(orders_of(level_field(levels)[level], MATRIX))))


def test_an_update_of_one_cell_is_the_sum_made_anew() -> None:
    level = np.random.default_rng(0).integers(0, LEVELS, (CELLS, CELLS))
    fields = level_field(LEVELS)
    dots = orders_of(fields[level], MATRIX)
    tried = shifted_orders(dots, (3, 11), fields - fields[level[3, 11]], MATRIX)
    for number in range(LEVELS):
        level[3, 11] = number
        anew = orders_of(fields[level], MATRIX)
        np.testing.assert_allclose(tried[number], anew, atol=1e-15)


@pytest.mark.parametrize("levels", [2, 4, 8])
def test_levels_are_the_nearest_ones_and_wrap(levels: int) -> None:
    step = 2 * np.pi / levels
    phase = np.array([[0.0, 0.49 * step], [-0.51 * step, 2 * np.pi - 0.1]])
    assert rounded(phase, levels).tolist() == [[0, 0], [levels - 1, 0]]


def test_in_the_end_no_cell_can_be_bettered_alone() -> None:
    rng = np.random.default_rng(2)
    first = rounded(gerchberg_saxton(MERIT.target, CELLS, rng), LEVELS)
    kept = first.copy()
    level = descend(first, LEVELS, MERIT, rng)
    np.testing.assert_array_equal(first, kept)
    reached = _merit(level)
    assert reached < _merit(first) - 0.01
    for place in np.ndindex(CELLS, CELLS):
        for number in range(LEVELS):
            other = level.copy()
            other[place] = number
            assert _merit(other) > reached - 1e-9


def test_a_sweep_that_may_not_be_made_changes_nothing() -> None:
    level = np.zeros((CELLS, CELLS), np.int64)
    found = descend(level, LEVELS, MERIT, np.random.default_rng(0), sweeps=0)
    np.testing.assert_array_equal(found, level)
