"""Lens and display are told apart by shifts, not by one picture and not by turns about the axis."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from camkit.calibration.flat.pose import Pose
from camkit.calibration.flat.separate import LEAST_SHARE, Parts, Views, separate
from tests.camkit.calibration.display_factory import GOOD, Flats, Shift

EXACT_TOLERANCE = 0.003
TOLERANCE = 0.01
LENS = Flats(centre=(0.02, -0.03))
STEP = 10
TURNS: Sequence[Shift] = ((0, 0, 0), (0, 0, 90), (0, 0, 180), (0, 0, 270))


def _views(shifts: Sequence[Shift], wrong: float = 0.0, seed: int = 0, lens: Flats = LENS) -> Views:
    """Give exact light; `wrong` is how far poses lie off what is stated, in widths and radians."""
    rng, unit = np.random.default_rng(seed), lens.radius_px
    y, x = np.mgrid[: lens.height : STEP, : lens.width : STEP].astype(np.float64)
    x = ((x - (lens.width - 1) / 2) / unit).ravel()
    y = ((y - (lens.height - 1) / 2) / unit).ravel()
    width = lens.width / unit
    falling = np.log(lens.lens(np.hypot(x - lens.centre[0], y - lens.centre[1])))
    light, poses = [], []
    for sx, sy, turn_deg in shifts:
        pose = Pose(shift_px=(sx * width, sy * width), turn_rad=math.radians(turn_deg))
        off = wrong * rng.standard_normal(3)
        true = Pose(
            shift_px=(pose.shift_px[0] + off[0] * width, pose.shift_px[1] + off[1] * width),
            turn_rad=pose.turn_rad + off[2],
        )
        light.append(falling + np.log(lens.display(*true.places(x, y))) + rng.uniform(-0.1, 0.1))
        poses.append(pose)
    return Views(
        log_light=np.array(light),
        x=x,
        y=y,
        poses=tuple(poses),
        centre=(0.0, 0.0),
        reach=1.1,
        width=width,
    )


def _error(parts: Parts, lens: Flats = LENS) -> float:
    radius = np.linspace(0, 1, 30)
    return float(np.abs(parts.illumination(radius) / lens.lens(radius) - 1).max())


@pytest.mark.parametrize("shifts", [GOOD, GOOD[:3], GOOD[:2], [GOOD[0], (0.2, 0, 0), GOOD[3]]])
def test_shifts_tell_lens_from_display_and_find_the_centre(shifts: Sequence[Shift]) -> None:
    parts = separate(_views(shifts))
    assert parts.separated
    assert parts.centre_found
    assert parts.centre == pytest.approx(LENS.centre, abs=1e-3)
    assert _error(parts) < EXACT_TOLERANCE
    assert parts.rms < 1e-3


@pytest.mark.parametrize("shifts", [GOOD[:1], TURNS, [GOOD[0]] * 3, [GOOD[0], (0.01, 0, 0)]])
def test_one_picture_or_turns_about_the_axis_do_not(shifts: Sequence[Shift]) -> None:
    parts = separate(_views(shifts))
    assert not parts.separated
    assert parts.share < LEAST_SHARE / 10
    assert _error(parts) > 0.04


def test_what_lens_and_display_both_explain_counts_as_the_lens() -> None:
    one = separate(_views(GOOD[:1]))
    radius = np.linspace(0, 0.9, 9)
    assert one.rms < 0.005
    assert (one.illumination(radius[1:]) < LENS.lens(radius[1:])).all()  # with the darker border


def test_poses_wrong_by_a_hundredth_of_the_width_cost_less_than_one_percent_rms() -> None:
    found = [separate(_views(GOOD, wrong=0.01, seed=seed)) for seed in range(12)]
    assert all(parts.separated for parts in found)
    assert np.sqrt(np.mean([_error(parts) ** 2 for parts in found])) < TOLERANCE


def test_the_share_grows_with_the_shift() -> None:
    shares = [
        separate(_views([(0, 0, 0), (s, 0, 0), (0, s, 0), (0, 0, 90)])).share
        for s in (0.02, 0.05, 0.1, 0.2, 0.33)
    ]
    assert (np.diff(shares) > 0).all()
    assert shares[2] < LEAST_SHARE < shares[3]


def test_a_lens_without_vignetting_has_no_centre_to_find() -> None:
    views = _views(GOOD)
    falling = np.log(LENS.lens(np.hypot(views.x - LENS.centre[0], views.y - LENS.centre[1])))
    parts = separate(replace(views, log_light=views.log_light - falling))
    assert parts.illumination(np.linspace(0, 1, 9)) == pytest.approx(1, abs=EXACT_TOLERANCE)
    assert not parts.centre_found
    assert parts.centre == views.centre


@pytest.mark.parametrize(("corner_share", "found"), [(0.0, False), (0.05, True), (1.0, True)])
def test_a_centre_is_found_in_vignetting_and_not_in_noise(corner_share: float, found: bool) -> None:
    views = _views(GOOD)
    falling = np.log(LENS.lens(np.hypot(views.x - LENS.centre[0], views.y - LENS.centre[1])))
    for seed in range(4):
        noise = 1e-3 * np.random.default_rng(seed).standard_normal(views.log_light.shape)
        light = views.log_light - (1 - corner_share) * falling + noise
        parts = separate(replace(views, log_light=light))
        assert parts.centre_found == found
        assert parts.centre == pytest.approx(LENS.centre if found else (0, 0), abs=0.006)
