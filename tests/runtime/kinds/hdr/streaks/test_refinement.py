"""Lights are refined near themselves, whatever else the picture holds."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.cells import Cells, coarser
from camkit.runtime.kinds.hdr.streaks.convolution import spreading
from camkit.runtime.kinds.hdr.streaks.kernels import StreakKernels
from camkit.runtime.kinds.hdr.streaks.recovery import veil_of
from camkit.runtime.kinds.hdr.streaks.refinement import (
    NEAR,
    CoarseLights,
    Group,
    groups_of,
    refined,
)
from camkit.runtime.kinds.hdr.streaks.regions import Window
from camkit.runtime.kinds.hdr.streaks.shapes import pooled, rim_distance_px
from tests.streak_factory import blurred, captured_cells, star, star_kernels, street, with_lamps

SIZE = (240, 321)
GREEN = 1
LAMPS = [
    (60, 60, 5.0, (60.0, 60.0, 60.0)),
    (66, 84, 2.0, (90.0, 90.0, 90.0)),
    (180, 250, 4.0, (30.0, 30.0, 30.0)),
]
"""The first two are neighbours."""


def _whole() -> Window:
    return Window(top=0, bottom=SIZE[0] // 4, left=0, right=SIZE[1] // 4)


def _cells(scene: FloatArray) -> Cells:
    return captured_cells(blurred(scene, star()))


def _found(cells: Cells, kernels: StreakKernels, scene: FloatArray) -> CoarseLights:
    """Give lights of green in cells of 4 px that have all their light, shared out evenly."""
    coarse = coarser(cells)
    clipped = coarse.clipped[GREEN] > 0
    truth = pooled(captured_truth(scene))[: clipped.shape[0], : clipped.shape[1]]
    light = np.where(clipped, np.maximum(truth, 0.01), 0).astype(np.float32)
    return CoarseLights(
        window=_whole(),
        light=light,
        blurred=spreading(kernels.coarse.whole[GREEN], clipped).spread(light),
        veil=veil_of(coarse.unclipped, kernels.coarse.veil)[GREEN],
        rim_px=rim_distance_px(cells.clipped[GREEN] > 0, cells.pitch_px),
    )


def captured_truth(scene: FloatArray) -> FloatArray:
    """Give the light of green in cells of 2 px."""
    return pooled(scene[GREEN])


@pytest.fixture(scope="module")
def scene() -> FloatArray:
    return with_lamps(street(*SIZE), LAMPS)


def _groups(cells: Cells) -> tuple[Group, ...]:
    return groups_of((coarser(cells).clipped > 0).any(axis=0))


def test_neighbours_are_one_group_and_lights_far_away_another(scene: FloatArray) -> None:
    groups = _groups(_cells(scene))
    assert len(groups) == 2
    clipped = (coarser(_cells(scene)).clipped > 0).any(axis=0)
    counts = np.zeros(clipped.shape, int)
    for group in groups:
        counts[group.window.at] += group.cells
    assert (counts[clipped] == 1).all()
    near, far = groups
    assert near.window.top == 0
    assert 66 // 4 < near.window.bottom - NEAR <= 68 // 4 + 1
    assert 244 // 4 <= far.window.left + NEAR < 250 // 4 < far.window.right


def test_refined_lights_lie_on_clipped_cells_and_keep_their_sum(scene: FloatArray) -> None:
    cells, kernels = _cells(scene), star_kernels()
    found = _found(cells, kernels, scene)
    light = refined(GREEN, found, _groups(cells), cells, kernels)
    clipped = cells.clipped[GREEN] > 0
    assert light.shape == clipped.shape
    assert (light[~clipped] == 0).all()
    assert (light[clipped] > 0).all()
    assert 4 * light.sum() == pytest.approx(scene[GREEN][scene[GREEN] > 1].sum(), rel=0.15)
    even = np.repeat(np.repeat(found.light, 2, 0), 2, 1)[: light.shape[0], : light.shape[1]]
    truth = captured_truth(scene)[: light.shape[0], : even.shape[1]]
    assert _gap(light[:, : even.shape[1]], truth) < 0.6 * _gap(even, truth)


def _gap(light: FloatArray, truth: FloatArray) -> float:
    return float(np.abs(light - np.where(truth > 1, truth, 0)).sum())


def test_a_group_does_not_hang_on_others_but_for_their_streaks(scene: FloatArray) -> None:
    """Sought alone, in any order, beside others whose light is known: the same bits."""
    cells, kernels = _cells(scene), star_kernels()
    found, groups = _found(cells, kernels, scene), _groups(cells)
    whole = refined(GREEN, found, groups, cells, kernels)
    turned = refined(GREEN, found, groups[::-1], cells, kernels)
    np.testing.assert_array_equal(whole, turned)
    apart = [refined(GREEN, found, [group], cells, kernels) for group in groups]
    np.testing.assert_array_equal(whole, np.max(apart, axis=0))


def test_what_lies_far_from_a_group_is_not_looked_at(scene: FloatArray) -> None:
    cells, kernels = _cells(scene), star_kernels()
    found, (group, _) = _found(cells, kernels, scene), _groups(cells)
    light = refined(GREEN, found, [group], cells, kernels)
    changed = cells.light.copy()
    far = 2 * group.window.bottom + 1
    changed[:, far:] = np.random.default_rng(0).random(changed[:, far:].shape)
    other = refined(GREEN, found, [group], replace(cells, light=changed), kernels)
    np.testing.assert_array_equal(light, other)


def test_a_colour_that_did_not_clip_has_no_light(scene: FloatArray) -> None:
    cells, kernels = _cells(scene), star_kernels()
    found = _found(cells, kernels, scene)
    clipped = cells.clipped.copy()
    clipped[GREEN] = 0
    dark = replace(cells, clipped=clipped)
    assert not refined(GREEN, found, _groups(cells), dark, kernels).any()
