"""Every clipped cell is sought in one window, and that holds its arms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from camkit.runtime.kinds.hdr.streaks.regions import Window, windows_of

MASKS = array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=40).flatmap(
    lambda shape: arrays(np.int8, shape, elements=st.sampled_from([0] * 29 + [1]))
)


def _mask(shape: tuple[int, int], *cells: tuple[int, int]) -> np.ndarray:
    mask = np.zeros(shape, bool)
    for cell in cells:
        mask[cell] = True
    return mask


def test_nothing_clipped_needs_no_window() -> None:
    assert windows_of(np.zeros((30, 40), bool), 5) == ()


def test_a_window_holds_the_arms_of_its_light() -> None:
    mask = _mask((40, 60), (20, 30), (20, 31))
    assert windows_of(mask, 6) == (Window(top=14, bottom=27, left=24, right=38),)


def test_a_window_ends_at_the_border() -> None:
    mask = _mask((40, 60), (2, 58))
    assert windows_of(mask, 6) == (Window(top=0, bottom=9, left=52, right=60),)


def test_lights_whose_arms_cannot_meet_are_apart_and_the_upper_left_comes_first() -> None:
    mask = _mask((60, 90), (50, 10), (5, 80), (5, 10))
    found = windows_of(mask, 5)
    assert [(w.top, w.left) for w in found] == [(0, 5), (0, 75), (45, 5)]


@pytest.mark.parametrize(("apart", "windows"), [(10, 1), (11, 1), (12, 2)])
def test_lights_whose_arms_meet_share_a_window(apart: int, windows: int) -> None:
    """Squares of 5 about two cells touch where these are 11 apart."""
    assert len(windows_of(_mask((30, 60), (15, 10), (15, 10 + apart)), 5)) == windows


def test_a_window_that_overlaps_another_becomes_one_with_it() -> None:
    """The corner of a ring of lights is empty, yet a light in it would be sought twice."""
    ring = [(5, x) for x in range(5, 60, 8)] + [(y, 5) for y in range(5, 60, 8)]
    mask = _mask((80, 80), *ring, (50, 50))
    assert len(windows_of(_mask((80, 80), *ring), 5)) == 1
    assert windows_of(mask, 5) == (Window(top=0, bottom=59, left=0, right=59),)


@settings(max_examples=150, deadline=None)
@given(mask=MASKS, reach=st.integers(0, 9))
def test_every_clipped_cell_lies_in_one_window_with_all_that_it_reaches(
    mask: np.ndarray, reach: int
) -> None:
    clipped = mask.astype(bool)
    found = windows_of(clipped, reach)
    assert found == windows_of(clipped.copy(), reach)
    height, width = clipped.shape
    owners = np.zeros(clipped.shape, int)
    for window in found:
        assert window.shape == owners[window.at].shape
        assert clipped[window.at].any()
        owners[window.at] += 1
    assert owners.max(initial=0) <= 1
    for y, x in np.argwhere(clipped):
        rows = slice(max(y - reach, 0), min(y + reach + 1, height))
        columns = slice(max(x - reach, 0), min(x + reach + 1, width))
        assert (owners[rows, columns] == 1).all()
        assert any(
            w.top <= rows.start
            and rows.stop <= w.bottom
            and w.left <= columns.start
            and columns.stop <= w.right
            for w in found
        )
    assert list(found) == sorted(found, key=lambda w: (w.top, w.left))


@pytest.mark.parametrize(
    ("shape", "bottom", "right"), [((20, 30), 20, 30), ((21, 30), 21, 30), ((21, 31), 21, 31)]
)
def test_the_finer_window_at_the_border_takes_the_odd_rest(
    shape: tuple[int, int], bottom: int, right: int
) -> None:
    window = Window(top=4, bottom=10, left=3, right=15)
    assert window.finer(shape) == Window(top=8, bottom=bottom, left=6, right=right)
    inner = Window(top=4, bottom=9, left=3, right=14)
    assert inner.finer(shape) == Window(top=8, bottom=18, left=6, right=28)


def test_a_window_moves_as_a_whole() -> None:
    window = Window(top=1, bottom=4, left=2, right=9)
    assert window.shifted(3, 5) == Window(top=4, bottom=7, left=7, right=14)
    assert window.shifted(3, 5).shape == window.shape
