"""Coarse lights become fine ones that still hold their light, where light may be."""

import numpy as np
import pytest
import scipy.ndimage
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.runtime.kinds.hdr.streaks.shapes import (
    DOME_PX,
    box_about,
    dome,
    pooled,
    rim_distance_px,
    upsampled,
    widened,
    with_means,
)

FLOAT32 = 1e-5


def _discs(height: int, width: int, *places: tuple[float, float, float]) -> np.ndarray:
    y, x = np.indices((height, width))
    return np.any([np.hypot(y - at_y, x - at_x) <= r for at_y, at_x, r in places], axis=0)


def test_the_distance_from_the_rim_is_that_to_the_next_cell_outside() -> None:
    mask = _discs(13, 17, (5, 6, 4), (10, 14, 1))
    outside = np.argwhere(~mask)
    wanted = [
        np.hypot(*(outside - at).T).min() if mask[tuple(at)] else 0 for at in np.ndindex(13, 17)
    ]
    got = rim_distance_px(mask, 2.0)
    np.testing.assert_allclose(got.ravel(), 2 * np.array(wanted), atol=FLOAT32)
    assert (rim_distance_px(np.zeros((3, 4), bool), 2.0) == np.zeros((3, 4))).all()


def test_a_box_holds_all_that_is_set_and_a_margin_within_the_mask() -> None:
    mask = _discs(13, 17, (5, 6, 2), (7, 9, 1))
    rows, columns = box_about(mask, 2)
    assert (rows.start, columns.start) == (1, 2)
    assert mask[rows, columns].shape == (10, 11)
    assert mask[rows, columns].sum() == mask.sum()
    assert box_about(np.ones((3, 4), bool), 5)[0].start == 0


def test_a_dome_rises_with_the_squared_distance_and_is_flat_where_that_is_large() -> None:
    distance = np.array([[0, 1, 2, DOME_PX, 3 * DOME_PX]], np.float32)
    np.testing.assert_allclose(dome(distance), [[0, 1, 4, DOME_PX**2, DOME_PX**2]])


@pytest.mark.parametrize("shape", [(2, 6, 8), (7, 5), (3, 2, 3)])
def test_pooled_cells_are_means_of_four(shape: tuple[int, ...]) -> None:
    fine = np.random.default_rng(0).uniform(0, 9, shape).astype(np.float32)
    got = pooled(fine)
    for at in np.ndindex(got.shape):
        *lead, y, x = at
        four = fine[(*lead, slice(2 * y, 2 * y + 2), slice(2 * x, 2 * x + 2))]
        assert got[at] == pytest.approx(four.mean(), rel=FLOAT32)


@pytest.mark.parametrize("shape", [(8, 12), (9, 13), (2, 3)])
def test_finer_cells_lie_on_the_line_between_the_middles_of_coarse_ones(
    shape: tuple[int, int],
) -> None:
    coarse = np.random.default_rng(0).uniform(0, 9, (shape[0] // 2, shape[1] // 2))
    rows = (np.arange(shape[0]) - 0.5) / 2
    columns = (np.arange(shape[1]) - 0.5) / 2
    lines = np.stack([np.interp(rows, np.arange(len(coarse)), c) for c in coarse.T], axis=1)
    wanted = np.stack([np.interp(columns, np.arange(coarse.shape[1]), line) for line in lines])
    got = upsampled(coarse.astype(np.float32), shape)
    assert got.shape == shape
    np.testing.assert_allclose(got, wanted, atol=FLOAT32)


@pytest.mark.parametrize("shape", [(24, 32), (25, 33)])
def test_lights_get_the_means_that_they_are_told_to_have(shape: tuple[int, int]) -> None:
    mask = _discs(*shape, (8, 9, 5), (18, 24, 3.4))
    base = dome(rim_distance_px(mask, 2.0))
    y, x = np.indices((shape[0] // 2, shape[1] // 2))
    means = np.where(pooled(base) > 0, 4 + np.sin(y / 2) + x / 9, 0).astype(np.float32)
    light = with_means(base, means)
    assert (light[~mask] == 0).all()
    total = means.sum()
    assert pooled(light).sum() == pytest.approx(total, rel=0.05)
    assert np.abs(pooled(base) / pooled(base).sum() - means / total).sum() > 0.5
    assert np.abs(pooled(light) - means).sum() < 0.1 * total


@pytest.mark.parametrize("shape", [(24, 40), (25, 41)])
def test_two_domes_of_different_light_come_back_from_their_means(shape: tuple[int, int]) -> None:
    mask = _discs(*shape, (8, 9, 5), (15, 32, 4.4))
    base = dome(rim_distance_px(mask, 2.0))
    truth = base * np.where(np.indices(shape)[1] < 20, 3, 7).astype(np.float32)
    light = with_means(base, pooled(truth))
    np.testing.assert_allclose(light, truth, rtol=1e-3)


@settings(max_examples=40, deadline=None)
@given(height=st.integers(2, 15), width=st.integers(2, 15), seed=st.integers(0, 99))
def test_no_light_appears_where_none_may_be(height: int, width: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    base = dome(rim_distance_px(rng.random((height, width)) < 0.4, 2.0))
    means = rng.uniform(0, 50, (height // 2, width // 2)).astype(np.float32)
    light = with_means(base, means)
    assert np.isfinite(light).all()
    assert (light[base == 0] == 0).all()
    assert light.shape == base.shape


@pytest.mark.parametrize("reach", [(0, 0), (1, 1), (3, 3), (2, 1), (9, 0)])
def test_a_widened_plane_has_the_largest_value_around(reach: tuple[int, int]) -> None:
    rng = np.random.default_rng(2)
    size = 2 * reach[0] + 1, 2 * reach[1] + 1
    plane = rng.normal(0, 1, (7, 23)).astype(np.float32)
    wanted = scipy.ndimage.maximum_filter(plane, size, mode="nearest")
    np.testing.assert_array_equal(widened(plane, *reach), wanted)
    mask = rng.random((7, 23)) > 0.95
    spread = scipy.ndimage.binary_dilation(mask, np.ones(size, np.bool_))
    np.testing.assert_array_equal(widened(mask, *reach), spread)
