"""Dense kernels by their parts: known arms come back, what has none is refused."""

import math
from typing import Any

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.models_def.optics.diffraction.streak_fit import (
    NoStreaksError,
    _haze,
    _line,
    _reach,
    fit_streaks,
)
from camkit.streaks import HAZE_STEP_PX, SECTION_STEP_PX, StreakOptics
from tests.hdr_bundle import CORE_PX, HAZE_SHARE, LAST_PX, WAVELENGTHS_UM, four_lines

MISPLACED = 4e-3
"""Of all the light; the arms alone have 6 %."""


def _fit(dense: FloatArray, bare: FloatArray, depths_mm: tuple[float, ...]) -> StreakOptics:
    return fit_streaks(
        dense,
        bare,
        depths_mm=depths_mm,
        wavelengths_um=WAVELENGTHS_UM,
        pitch_um=5.96,
        core_px=CORE_PX,
    )


@pytest.fixture(scope="module")
def fitted() -> tuple[StreakOptics, StreakOptics]:
    """What the kernels were made of, and what was found of them."""
    depths_mm = (1000.0, 5000.0)
    made = four_lines(depths_mm=depths_mm)
    return made, _fit(made.dense(), made.dense(bare=True), depths_mm)


def _placed(kernels: FloatArray, side: int) -> FloatArray:
    beside = (side - kernels.shape[-1]) // 2
    if beside < 0:
        return kernels[..., -beside:beside, -beside:beside]
    return np.pad(kernels, ((0, 0), (0, 0), (beside, beside), (beside, beside)))


def test_parts_make_the_kernels_that_they_were_told_from(
    fitted: tuple[StreakOptics, StreakOptics],
) -> None:
    made, found = fitted
    dense = made.dense()
    again = _placed(found.dense(), dense.shape[-1])
    misplaced = np.abs(again - dense).sum((-2, -1)) / 2
    assert misplaced.max() < MISPLACED
    np.testing.assert_allclose(again.sum((-2, -1)), dense.sum((-2, -1)), atol=MISPLACED)


def test_arms_lie_where_they_were_drawn_and_end_there(
    fitted: tuple[StreakOptics, StreakOptics],
) -> None:
    made, found = fitted
    wanted = np.degrees(made.angles_rad) % 360
    np.testing.assert_allclose(np.sort(np.degrees(found.angles_rad) % 360), wanted, atol=0.05)
    assert abs(found.reach_px - LAST_PX) <= 2
    beyond = np.s_[..., CORE_PX // 2 + 4 :]
    for arm in range(len(wanted)):
        light = found.profiles[beyond][:, :, arm].sum(-1)
        np.testing.assert_allclose(light, made.profiles[beyond][:, :, 0].sum(-1), rtol=0.06)


def test_what_needs_no_fit_is_kept_as_it_was(fitted: tuple[StreakOptics, StreakOptics]) -> None:
    made, found = fitted
    np.testing.assert_array_equal(found.core, made.core)
    np.testing.assert_array_equal(found.bare_core, made.bare_core)
    assert found.depths_mm.tolist() == made.depths_mm.tolist()
    assert found.wavelengths_um.tolist() == made.wavelengths_um.tolist()
    assert found.pixel_pitch_um == made.pixel_pitch_um
    integral = found.sections.sum(-1) * SECTION_STEP_PX
    np.testing.assert_allclose(integral, 1, rtol=1e-5)


def test_haze_is_told_from_arms(fitted: tuple[StreakOptics, StreakOptics]) -> None:
    made, found = fitted
    squares = found.haze.shape[-1]
    assert found.haze.sum((-2, -1)).max() * HAZE_STEP_PX**2 == pytest.approx(
        HAZE_SHARE * (squares / made.haze.shape[-1]) ** 2, rel=0.3
    )


def test_kernels_without_arms_are_refused() -> None:
    bare = four_lines().dense(bare=True)
    with pytest.raises(NoStreaksError, match="no streaks were found"):
        _fit(bare, bare, (5000.0,))


@pytest.mark.parametrize("half", [30, 38])
def test_arms_that_go_on_beyond_the_kernels_are_refused(half: int) -> None:
    made = four_lines()
    dense, bare = (
        np.ascontiguousarray(_placed(k, 2 * half + 1))
        for k in (made.dense(), made.dense(bare=True))
    )
    with pytest.raises(NoStreaksError, match="do not end within the kernels"):
        _fit(dense, bare, (5000.0,))


def test_the_reach_holds_nearly_all_light_of_the_longest_arm() -> None:
    profiles = np.zeros((1, 1, 2, 60))
    profiles[..., 0, :30] = 1
    profiles[..., 1, :41] = 1
    profiles[..., 41:58] = 1e-5
    assert _reach(profiles, 5) == 40


# ------------------------------------------------------------------------------ the pieces


def test_a_line_is_that_of_least_squares() -> None:
    rng = np.random.default_rng(0)
    truth = rng.uniform(1, 5, 9)
    place = rng.uniform(0, 8, 400)
    weight = rng.uniform(0.2, 2, 400)
    light = weight * np.interp(place, np.arange(9), truth)
    np.testing.assert_allclose(_line(light, place, weight, 9), truth, rtol=0.02)


def test_a_line_is_never_negative_and_even_where_nothing_tells() -> None:
    place = np.array([0.0, 0.5, 1.0, 8.0])
    found = _line(np.array([4.0, 4.0, 4.0, -3.0]), place, np.ones(4), 9)
    assert (found >= 0).all()
    assert np.abs(np.diff(found[2:8])).max() < 1


def _even(side: int, squares: slice) -> tuple[Any, Any]:
    kernel = np.full((side, side), 2e-6)
    usable = np.ones((side, side), bool)
    usable[squares, squares] = False
    kernel[~usable] = 1.0  # an arm, which is no haze
    return kernel, usable


def test_haze_under_an_arm_is_that_of_its_ring() -> None:
    kernel, usable = _even(57, slice(20, 37))
    haze = _haze(kernel, usable)
    assert haze.shape[0] % 2 == 1
    np.testing.assert_allclose(haze, 2e-6, rtol=1e-9)


def test_haze_follows_what_is_seen_of_it() -> None:
    place = np.arange(89) - 44
    kernel = 1e-5 / (1 + np.hypot(place[:, None], place[None, :]) / 10)
    haze = _haze(kernel, np.ones_like(kernel, bool))
    middle = haze.shape[0] // 2
    for square in (0, 2, 4):
        start = 44 + HAZE_STEP_PX * square
        wanted = kernel[start - 4 : start + 4, 40:48].mean()
        assert haze[middle + square, middle] == pytest.approx(wanted, rel=0.1)
    assert math.isclose(haze[0, middle], haze[-1, middle], rel_tol=0.05)
