"""Demosaicking along edges on lattices: the same as on whole planes with masks."""

from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.arrays import FloatArray
from camkit.cfa import CFA_PATTERNS, CfaPattern, cfa_channels
from camkit.runtime.signal.demosaic import demosaic, demosaic_part

ROUNDING = 2e-5
"""Of values of about 1; the weights are quotients of squares."""
INTERPOLATE, CHANGE, MEAN2, MEAN3 = (
    np.array([taps], np.float32)
    for taps in ([-0.25, 0.5, 0.5, 0.5, -0.25], [-1, 0, 1], [0.5, 0, 0.5], [1 / 3, 1 / 3, 1 / 3])
)
Filter = Callable[[FloatArray], FloatArray]


def _filters(taps: FloatArray) -> tuple[Filter, Filter]:
    """Return a filter along rows and one along columns; the border is mirrored."""

    def along(plane: FloatArray, kernel: FloatArray) -> FloatArray:
        made = cv2.filter2D(plane, cv2.CV_32F, kernel, borderType=cv2.BORDER_REFLECT_101)
        return np.asarray(made, np.float32)

    return partial(along, kernel=taps), partial(along, kernel=np.ascontiguousarray(taps.T))


def _mixed(plane: FloatArray, taps: FloatArray, row_weight: FloatArray) -> FloatArray:
    by_row, by_column = (along(plane) for along in _filters(taps))
    return row_weight * by_row + (1 - row_weight) * by_column


def _with_red_and_blue_at_green(
    planes: FloatArray, own: FloatArray, colors: FloatArray
) -> FloatArray:
    """Add the mean colour difference of the two neighbours to green."""
    out = planes.copy()
    for color in (0, 2):
        by_row, by_column = (
            along(np.where(own == color, planes[color] - planes[1], np.float32(0)))
            for along in _filters(MEAN2)
        )
        in_row = np.resize((colors == color).any(axis=1), own.shape[0])[:, None]
        found = np.where(in_row, by_row, by_column)
        out[color] = np.where(own == 1, planes[1] + found, planes[color])
    return out


def _with_opposites(
    planes: FloatArray, own: FloatArray, row_weight: FloatArray, taps: FloatArray
) -> FloatArray:
    found = _mixed(planes[0] - planes[2], taps, row_weight)
    out = planes.copy()
    out[0] = np.where(own == 2, planes[2] + found, planes[0])
    out[2] = np.where(own == 0, planes[0] - found, planes[2])
    return out


def obvious_directional(mosaic: FloatArray, cfa: CfaPattern) -> FloatArray:
    """Return the planes by the published steps, each over the whole picture."""
    colors = np.array(cfa_channels(cfa))
    height, width = mosaic.shape
    own = np.tile(colors, ((height + 1) // 2, (width + 1) // 2))[:height, :width]
    along = [one(mosaic) for one in _filters(INTERPOLATE)]
    sign = np.where(own == 1, np.float32(1), np.float32(-1))
    changes = [
        np.abs(change(sign * (mosaic - plane)))
        for change, plane in zip(_filters(CHANGE), along, strict=True)
    ]
    against_row, against_column = (
        np.square(cv2.filter2D(c, -1, np.ones((5, 5)), borderType=cv2.BORDER_REFLECT_101))
        for c in changes
    )
    whole = against_row + against_column
    weight = np.divide(against_column, whole, out=np.full_like(whole, 0.5), where=whole > 0)
    green = np.where(own == 1, mosaic, weight * along[0] + (1 - weight) * along[1])
    planes = np.stack([np.where(own == 0, mosaic, 0), green, np.where(own == 2, mosaic, 0)])
    planes = _with_red_and_blue_at_green(planes, own, colors)
    planes = _with_opposites(planes, own, weight, MEAN2)
    for color in (0, 2):
        smooth = _mixed(planes[color] - planes[1], MEAN3, weight)
        planes[1] = np.where(own == color, planes[color] - smooth, planes[1])
    planes = _with_red_and_blue_at_green(planes, own, colors)
    return _with_opposites(planes, own, weight, MEAN3)


@given(
    cfa=st.sampled_from(CFA_PATTERNS),
    sides=st.tuples(st.integers(2, 40), st.integers(2, 40)).filter(lambda s: max(s) > 3),
    seed=st.integers(0, 2**16),
)
@settings(deadline=None, max_examples=60)
def test_lattices_give_what_whole_planes_do(
    cfa: CfaPattern, sides: tuple[int, int], seed: int
) -> None:
    """In 3 px and fewer on each side no change is left but rounding errors, so none is weighed."""
    mosaic = np.random.default_rng(seed).normal(0.3, 0.4, sides).astype(np.float32)
    wanted = obvious_directional(mosaic, cfa)
    np.testing.assert_allclose(demosaic(mosaic, cfa, "quality"), wanted, atol=ROUNDING)


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_several_tiles_give_what_whole_planes_do(cfa: CfaPattern) -> None:
    mosaic = np.random.default_rng(7).normal(0.3, 0.4, (263, 1031)).astype(np.float32)
    wanted = obvious_directional(mosaic, cfa)
    np.testing.assert_allclose(demosaic(mosaic, cfa, "quality"), wanted, atol=ROUNDING)


@given(
    cfa=st.sampled_from(CFA_PATTERNS),
    sides=st.tuples(st.integers(1, 150), st.integers(1, 560)),
    data=st.data(),
)
@settings(deadline=None, max_examples=40)
def test_a_part_is_that_of_the_whole_bit_for_bit(
    cfa: CfaPattern, sides: tuple[int, int], data: st.DataObject
) -> None:
    mosaic = np.random.default_rng(sum(sides)).random(sides, dtype=np.float32)
    top, left = (data.draw(st.integers(0, side - 1)) for side in sides)
    bottom, right = (
        data.draw(st.integers(first + 1, side))
        for first, side in zip((top, left), sides, strict=True)
    )
    part = demosaic_part(mosaic, cfa, "quality", (top, left, bottom, right))
    whole = demosaic(mosaic, cfa, "quality")
    np.testing.assert_array_equal(part, whole[:, top:bottom, left:right])


@pytest.mark.parametrize("sides", [(1, 1), (1, 9), (9, 1), (2, 2), (2, 3), (3, 3)])
@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_the_smallest_mosaics_keep_samples_and_grey(
    cfa: CfaPattern, sides: tuple[int, int]
) -> None:
    mosaic = np.random.default_rng(1).random(sides, dtype=np.float32)
    planes = demosaic(mosaic, cfa, "quality")
    assert np.isfinite(planes).all()
    for y, x in np.ndindex(sides):
        assert planes[cfa_channels(cfa)[y % 2][x % 2], y, x] == mosaic[y, x]
    grey = np.full(sides, 0.25, np.float32)
    np.testing.assert_allclose(demosaic(grey, cfa, "quality"), 0.25, atol=1e-6)
