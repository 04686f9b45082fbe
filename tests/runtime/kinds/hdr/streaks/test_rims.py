"""Rims of lights are tinted neither by the levels of the sensor nor by a demosaic."""

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.rims import (
    AROUND_PX,
    MARGIN_PX,
    MOST_RAISED,
    colour_by_surroundings,
    in_own_colours,
)

LEVELS = np.array([[2.7], [1.0], [1.4]], np.float32)
ALL = np.ones((3, 1), np.bool_)
SIDE = 32


@pytest.mark.parametrize("excess", [0.0, 5.0, 200.0])
def test_light_hardly_above_what_clips_has_the_tint_of_no_sensor(excess: float) -> None:
    """All colours clipped at levels of their own, which are pink: a white lamp stays white."""
    white = np.full((3, 1), excess, np.float32)
    got = in_own_colours(LEVELS.copy(), ALL, white, LEVELS)[:, 0]
    np.testing.assert_allclose(got, [2.7, MOST_RAISED, 2.7], rtol=1e-5)


def test_a_lamp_keeps_its_colour_and_nothing_is_darkened() -> None:
    red = np.array([[30.0], [1.0], [1.0]], np.float32)
    light = np.array([[40.0], [1.5], [1.6]], np.float32)
    np.testing.assert_array_equal(in_own_colours(light, ALL, red, LEVELS), light)
    some = np.array([[True], [False], [True]])
    seen = np.array([[2.7], [0.4], [1.4]], np.float32)
    got = in_own_colours(seen, some, np.zeros((3, 1), np.float32), LEVELS)
    assert (got >= seen).all()
    assert got[1, 0] == np.float32(0.4)


def _tinted() -> tuple[FloatArray, np.ndarray]:
    """Return a green wall about a clipped square, pink where a demosaic mixes that in."""
    planes = np.full((3, SIDE, SIDE), 0.2, np.float32)
    planes *= np.array([1.0, 2.0, 0.5], np.float32)[:, None, None]
    clipped = np.zeros((SIDE, SIDE), np.bool_)
    clipped[12:18, 12:18] = True
    planes[:, 11:19, 11:19] = np.array([0.8, 0.3, 0.6], np.float32)[:, None, None]
    planes[:, clipped] = LEVELS
    return planes, clipped


def _coloured(planes: FloatArray, clipped: NDArray[np.bool_], lit: NDArray[np.bool_]) -> FloatArray:
    out = planes.copy()
    colour_by_surroundings(out, clipped, lit)
    return out


def test_pixels_beside_clipped_samples_have_the_colour_of_what_lies_around() -> None:
    planes, clipped = _tinted()
    got = _coloured(planes, clipped, clipped)
    beside = np.zeros_like(clipped)
    beside[11:19, 11:19] = True
    beside &= ~clipped
    share = got[:, beside] / got[:, beside].sum(axis=0)
    np.testing.assert_allclose(share, np.tile([[1 / 3.5], [2 / 3.5], [0.5 / 3.5]], share.shape[1]))
    np.testing.assert_allclose(got.sum(axis=0), planes.sum(axis=0), rtol=1e-5)


def test_everything_else_keeps_its_bits() -> None:
    planes, clipped = _tinted()
    got = _coloured(planes, clipped, clipped)
    near = np.zeros_like(clipped)
    near[10:20, 10:20] = True
    np.testing.assert_array_equal(got[:, ~near], planes[:, ~near])
    np.testing.assert_array_equal(got[:, clipped], planes[:, clipped])
    every = np.ones_like(clipped)
    np.testing.assert_array_equal(_coloured(planes, every, every), planes)


def test_where_nothing_else_was_seen_colours_stay() -> None:
    planes, clipped = np.full((3, 9, 9), 0.4, np.float32), np.ones((9, 9), np.bool_)
    planes[0] = 0.9
    clipped[4, 4] = False
    np.testing.assert_array_equal(_coloured(planes, clipped, clipped), planes)


def test_a_cut_with_its_margin_has_the_bits_of_the_whole() -> None:
    rng = np.random.default_rng(4)
    planes = rng.uniform(-0.1, 1, (3, 60, 40)).astype(np.float32)
    clipped = rng.random((60, 40)) > 0.98
    whole = _coloured(planes, clipped, clipped)
    assert (whole != planes).any()
    assert MARGIN_PX > AROUND_PX
    part = np.s_[20 - MARGIN_PX : 45 + MARGIN_PX]
    got = _coloured(planes[:, part], clipped[part], clipped[part])
    np.testing.assert_array_equal(got[:, MARGIN_PX:-MARGIN_PX], whole[:, 20:45])
