"""Lamps, colours, lines and streaks as the scenarios put them."""

import math

import numpy as np
import pytest

from camkit.report.kinds.hdr.lights import (
    stretched,
    turned,
    with_colour,
    with_lamp,
    with_line,
    with_peak,
    writes_streaks,
)
from tests.hdr_bundle import LAST_PX, STREAK_SHARE, four_lines, write_hdr_bundle
from tests.wide_bundle import write_wide_bundle

DARK = np.full((3, 41, 61), 0.1, np.float32)


def test_a_lamp_is_round_brightest_in_its_middle_and_soft_at_its_rim() -> None:
    lit = with_lamp(DARK, (20, 30), 6.0, 50.0)
    assert lit[:, 20, 30] == pytest.approx(50)
    assert lit[0, 20, 34] == lit[0, 24, 30] == lit[0, 16, 30] < 50
    assert 0.1 < lit[0, 20, 36] < lit[0, 20, 35]
    np.testing.assert_array_equal(lit[:, 20, 37:], DARK[:, 20, 37:])
    outside = with_lamp(DARK, (-9, 30), 6.0, 50.0)
    np.testing.assert_array_equal(outside, DARK)


def test_the_peak_moves_and_white_stays_white() -> None:
    lit = with_lamp(DARK, (20, 30), 6.0, 64.0)
    lit[:, 0, 0] = (0.5, 1.0, 0.2)
    for peak in (2.0, 64.0, 4096.0):
        found = with_peak(lit, peak)
        assert found.max() == pytest.approx(peak, rel=1e-4)
        np.testing.assert_array_equal(found > 1, lit > 1)
        np.testing.assert_allclose(found[:, 0, 0], lit[:, 0, 0], rtol=1e-6)
    coloured = (
        with_lamp(DARK, (20, 30), 6.0, 64.0) * np.array([1, 0.5, 0.25], np.float32)[:, None, None]
    )
    found = with_peak(coloured, 16.0)
    np.testing.assert_allclose(found[1], 0.5 * found[0], rtol=1e-5)
    np.testing.assert_array_equal(with_peak(DARK, 16.0), DARK)


def test_lights_get_a_colour_and_the_rest_keeps_its_own() -> None:
    lit = with_lamp(DARK, (20, 30), 6.0, 50.0)
    red = with_colour(lit, (1.0, 0.1, 0.0))
    np.testing.assert_allclose(red[:, 20, 30], (50, 5, 0), rtol=1e-5)
    np.testing.assert_array_equal(red[:, :5], DARK[:, :5])


@pytest.mark.parametrize("angle_deg", [0, 30, 90, 160])
def test_a_line_lies_along_its_angle_and_ends(angle_deg: float) -> None:
    angle = math.radians(angle_deg)
    added = with_line(DARK, (20.0, 30.0), angle, 12.0, 0.5)[1] - 0.1
    y, x = np.nonzero(added > 0.2)
    along = (x - 30) * math.cos(angle) + (y - 20) * math.sin(angle)
    across = (y - 20) * math.cos(angle) - (x - 30) * math.sin(angle)
    assert np.abs(across).max() < 1.5
    assert along.min() == pytest.approx(-12, abs=1)
    assert along.max() == pytest.approx(12, abs=1)
    assert added[20, 30] == pytest.approx(0.5, abs=1e-6)


def test_streaks_are_turned_and_nothing_else() -> None:
    streaks = four_lines()
    quarter = turned(streaks, math.pi / 2)
    dense, expected = quarter.dense()[0, 0], np.rot90(streaks.dense()[0, 0], -1)
    np.testing.assert_allclose(dense, expected, atol=1e-6)


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.1])
def test_stretched_streaks_end_elsewhere_and_hold_the_same_light(factor: float) -> None:
    streaks = stretched(four_lines(), factor)
    profile = streaks.profiles[0, 0, 0]
    assert profile.sum() * 8 == pytest.approx(STREAK_SHARE, rel=0.02)
    last = np.flatnonzero(profile > 0.5 * profile.max())[-1]
    assert last == pytest.approx(factor * LAST_PX, abs=1)
    if factor == 1:
        np.testing.assert_array_equal(streaks.profiles, four_lines().profiles)


def test_cameras_without_streaks_take_no_part(tmp_path) -> None:
    assert writes_streaks(write_hdr_bundle(tmp_path)) is None
    assert writes_streaks(write_wide_bundle(tmp_path)) == "its optics write no streaks"
