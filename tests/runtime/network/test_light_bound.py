"""Laws of the bound on moved light, against sums written out pixel by pixel."""

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.bundle.light_bound import (
    BOUND_REACH_PX,
    BRIGHT_FROM,
    CELL_PX,
    NEAR_PX,
    USUAL_BOUND,
    LightBound,
)
from camkit.errors import ContractError
from camkit.runtime.network import light_bound
from camkit.runtime.network.light_bound import (
    KeptRows,
    added_light,
    keep_bright,
    keep_share,
    take_back,
)
from camkit.runtime.rows import ArrayRows

SCALE = 64.0
DETAIL = LightBound()
Array = NDArray[np.float32]


def _bounded(front: Array, output: Array, kept: Array | None, bound: LightBound) -> Array:
    made = output.copy()
    added = added_light(front, made, kept, bound, scale=SCALE)
    take_back(front, made, kept, added.excess)
    return made


def _window(seed: int, height: int = 40, width: int = 56) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    front = rng.uniform(0.2, 2.0, (3, height, width)).astype(np.float32)
    return front, front + 0.2 * rng.standard_normal(front.shape).astype(np.float32)


def _slow_change(front: Array, output: Array, kept: Array | None, y: int, x: int) -> Array:
    """Compute the change of the cell (y, x) as the format says, one pixel at a time."""
    _, height, width = front.shape
    rows, columns = height // CELL_PX, width // CELL_PX
    moved, weight = np.zeros((2, front.shape[0]))
    for dy, wy in ((-1, 0.25), (0, 0.5), (1, 0.25)):
        for dx, wx in ((-1, 0.25), (0, 0.5), (1, 0.25)):
            i, j = min(max(y + dy, 0), rows - 1), min(max(x + dx, 0), columns - 1)
            for py in range(CELL_PX * i, CELL_PX * (i + 1)):
                for px in range(CELL_PX * j, CELL_PX * (j + 1)):
                    share = 1.0 if kept is None else float(kept[py, px])
                    after, before = np.maximum(output[:, py, px], 0), front[:, py, px]
                    moved += wy * wx * share * (after - before) * (after + before)
                    weight += wy * wx * share * (after + before)
    return np.asarray(moved / weight, np.float32)


@pytest.mark.parametrize("clipped", [False, True])
def test_the_change_of_a_cell_is_the_weighted_mean_around_it(clipped: bool) -> None:
    front, output = _window(0)
    mask = np.zeros((1, 40, 56), np.bool_)
    mask[0, 18, 30] = clipped
    kept = keep_share(mask)
    added = added_light(front, output.copy(), kept, DETAIL, scale=SCALE)
    for y, x in ((0, 0), (4, 7), (9, 13), (5, 6)):
        wanted = _slow_change(front, output, kept, y, x)
        np.testing.assert_allclose(added.excess[:, y, x], wanted, atol=2e-6)


def test_an_even_area_keeps_the_light_of_its_front_end() -> None:
    front = np.full((3, 64, 64), 1.3, np.float32)
    output = front * np.float32(0.8)  # a network that loses 36 % of the light
    made = _bounded(front, output, None, DETAIL)
    np.testing.assert_allclose(made**2, front**2, rtol=2e-2)
    again = _bounded(front, made, None, DETAIL)
    np.testing.assert_allclose(again**2, front**2, rtol=2e-4)


def test_detail_whose_mean_is_right_stays_as_it_is() -> None:
    front = np.full((3, 64, 64), 1.0, np.float32)
    y, x = np.mgrid[:64, :64]
    light = 1 + 0.3 * np.where((y + x) % 2 == 0, 1, -1)
    output = np.sqrt(np.broadcast_to(light, front.shape)).astype(np.float32)
    np.testing.assert_allclose(_bounded(front, output, None, DETAIL), output, atol=1e-6)


def test_within_the_bound_nothing_is_taken_back() -> None:
    front, output = _window(1)
    wide = LightBound(noise=100.0, light=10.0)
    made = _bounded(front, output, None, wide)
    np.testing.assert_array_equal(made, np.maximum(output, 0))


@pytest.mark.parametrize("deviations", [0.5, 1.0, 3.0])
def test_what_stays_of_an_even_change_is_at_most_what_noise_explains(deviations: float) -> None:
    front = np.full((1, 40, 40), 1.0, np.float32)
    made = _bounded(front, front + np.float32(0.2), None, LightBound(noise=deviations))
    noise = 0.5 / SCALE / np.sqrt(CELL_PX**2 * 64 / 9)
    np.testing.assert_allclose(made - front, deviations * noise, rtol=1e-3)


def test_beside_clipped_samples_the_front_end_stays() -> None:
    front, output = _window(2)
    mask = np.zeros((40, 56), np.bool_)
    mask[20, 28] = True
    kept = keep_share(mask)
    assert kept is not None
    made = _bounded(front, output, kept, DETAIL)
    near, far = NEAR_PX
    inside = np.s_[:, 20 - near : 21 + near, 28 - near : 29 + near]
    np.testing.assert_array_equal(made[inside], front[inside])
    assert kept[20 - far, 28] == 0.5
    assert kept[20 - far - 1, 28] == 1


def test_far_from_clipped_samples_a_window_gives_the_bits_of_one_without_any() -> None:
    front, output = _window(11, 96, 96)
    output *= np.linspace(0.05, 6, 96, dtype=np.float32)  # far from the front end: sums round
    mask = np.zeros((96, 96), np.bool_)
    mask[4, 4] = True
    bound = LightBound(spread=0.2)
    with_mask = _bounded(front, output, keep_share(mask), bound)
    without = _bounded(front, output, None, bound)
    first = 4 + BOUND_REACH_PX + max(NEAR_PX) + 1
    far = np.s_[:, first:, first:]
    np.testing.assert_array_equal(with_mask[far], without[far])


def test_a_mask_by_rows_is_the_mask_of_the_whole() -> None:
    rng = np.random.default_rng(3)
    mask = rng.random((1, 50, 40)) > 0.99
    whole = keep_share(mask)
    rows = KeptRows(ArrayRows(mask))
    for top, bottom in ((0, 7), (5, 20), (20, 50)):
        np.testing.assert_array_equal(rows.read(top, bottom)[0], whole[top:bottom])
    empty = KeptRows(ArrayRows(np.zeros_like(mask)))
    assert empty.read(3, 9).min() == 1


@pytest.mark.parametrize("bound", [DETAIL, USUAL_BOUND])
@pytest.mark.parametrize(("top", "left"), [(0, 0), (16, 24), (40, 8)])
def test_a_window_equals_the_whole_in_bits_beyond_its_reach(
    bound: LightBound, top: int, left: int
) -> None:
    front, output = _window(4, 96, 104)
    mask = np.random.default_rng(5).random((96, 104)) > 0.998
    kept = keep_share(mask)
    whole = _bounded(front, output, kept, bound)
    part = np.s_[:, top : top + 56, left : left + 72]
    cut = _bounded(
        np.ascontiguousarray(front[part]), output[part].copy(), kept[part[1:]].copy(), bound
    )
    inner = [
        slice(BOUND_REACH_PX * (first > 0), length - BOUND_REACH_PX * (first + length < side))
        for first, length, side in ((top, 56, 96), (left, 72, 104))
    ]
    np.testing.assert_array_equal(cut[:, inner[0], inner[1]], whole[part][:, inner[0], inner[1]])


def test_a_pixel_reaches_as_far_as_stated_and_no_further() -> None:
    front, output = _window(6, 64, 64)
    before = _bounded(front, output, None, DETAIL)
    reached = 0
    for y in range(24, 32):
        changed = output.copy()
        changed[:, y, 30] += 1
        moved = (_bounded(front, changed, None, DETAIL) != before).any(axis=0)
        rows = np.nonzero(moved.any(axis=1))[0]
        reached = max(reached, y - rows.min(), rows.max() - y)
    assert reached == BOUND_REACH_PX


def test_the_rows_computed_at_once_do_not_change_a_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    front, output = _window(7, 160, 96)
    at_once = _bounded(front, output, None, USUAL_BOUND)
    monkeypatch.setattr(light_bound, "_STEP_CELLS", 8)
    np.testing.assert_array_equal(_bounded(front, output, None, USUAL_BOUND), at_once)


def test_strength_mixes_what_is_left_with_the_front_end() -> None:
    front, output = _window(8, 39, 54)
    made = output.copy()
    take_back(front, made, None, None, strength=0.25)
    np.testing.assert_allclose(made, front + 0.25 * (output - front), atol=1e-6)


def test_much_moved_light_is_told_from_little() -> None:
    front = np.full((1, 40, 40), 1.0, np.float32)
    little = added_light(front, front * np.float32(1.03), None, DETAIL, scale=SCALE)
    much = added_light(front, front * np.float32(0.7), None, DETAIL, scale=SCALE)
    assert little.unexplained.all()
    assert not little.large.any()
    assert much.unexplained.all()
    assert much.large.all()


def test_sides_that_are_no_whole_cells_are_refused() -> None:
    front, output = _window(9, 38, 56)
    with pytest.raises(ContractError, match="multiples of 4"):
        added_light(front, output, None, DETAIL, scale=SCALE)


def test_what_is_nearly_white_in_every_colour_is_not_darkened_by_more_than_noise() -> None:
    bright = np.array([0.9, 1.0, 1.1], np.float32)
    front = np.broadcast_to(bright[:, None, None], (3, 6, 8)).copy()
    front[1, :3] *= np.float32(BRIGHT_FROM)  # one colour is dark
    front[:, 3:, 4:] += 1
    output = np.zeros_like(front)
    output[:, :, 7] = 3
    made = output.copy()
    keep_bright(front, made, bright, scale=SCALE)
    np.testing.assert_array_equal(made[:, :3], output[:, :3])
    np.testing.assert_allclose(made[:, 3:, :7], front[:, 3:, :7] - 8 * 0.5 / SCALE, rtol=1e-6)
    np.testing.assert_array_equal(made[:, :, 7], 3)


def test_less_bright_pixels_may_become_darker_without_a_step() -> None:
    """A step would leave a hatched pattern of pixels on either side of it."""
    bright = np.ones(3, np.float32)
    front = np.broadcast_to(np.linspace(0.5, 1.2, 200, dtype=np.float32), (3, 4, 200)).copy()
    made = np.zeros_like(front)
    keep_bright(front, made, bright, scale=1e6)
    steps = np.diff(made[0, 0])
    assert made[0, 0, 0] == 0
    np.testing.assert_allclose(made[0, 0, -40:], front[0, 0, -40:], rtol=1e-4)
    assert steps.min() >= 0
    assert steps.max() < 6 * (front[0, 0, 1] - front[0, 0, 0])


def test_light_that_is_brightened_or_smoothed_within_noise_stays() -> None:
    """Grain of the filter around white is still taken away."""
    rng = np.random.default_rng(3)
    bright = np.full(3, 0.9, np.float32)
    front = (1 + 0.5 / SCALE * rng.standard_normal((3, 64, 64))).astype(np.float32)
    output = np.ones_like(front)
    made = output.copy()
    keep_bright(front, made, bright, scale=SCALE)
    np.testing.assert_array_equal(made, output)


def test_nearly_white_is_judged_pixel_by_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    """So a window, a strip of rows and the whole have the same bits."""
    front, output = _window(5)
    bright = np.full(3, 0.8, np.float32)
    whole = output.copy()
    keep_bright(front, whole, bright, scale=SCALE)
    assert (whole != output).any()
    cut = output[:, 7:30, 5:50].copy()
    monkeypatch.setattr(light_bound, "_STEP_CELLS", 2)
    keep_bright(front[:, 7:30, 5:50], cut, bright, scale=SCALE)
    np.testing.assert_array_equal(cut, whole[:, 7:30, 5:50])
