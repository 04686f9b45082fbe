"""What is photographed moves in the picture as the pose says."""

import math

import numpy as np
import pytest

from camkit.calibration.flat.pose import Pose, orientation_turn_deg, poses_of
from camkit.errors import ContractError

EXACT = 1e-12


def _seen(pose: Pose, x: float, y: float) -> tuple[float, float]:
    """Give what is seen at a pixel."""
    found = pose.places(np.array([x]), np.array([y]))
    return float(found[0][0]), float(found[1][0])


def test_what_moved_to_the_right_and_down_is_seen_there() -> None:
    pose = Pose(shift_px=(30.0, 7.0))
    assert _seen(pose, 35.0, 9.0) == pytest.approx((5.0, 2.0), abs=EXACT)


def test_a_clockwise_turn_brings_the_right_side_down() -> None:
    pose = Pose(turn_rad=math.radians(90))
    assert _seen(pose, 0.0, 10.0) == pytest.approx((10.0, 0.0), abs=EXACT)


def test_a_turn_is_about_the_middle_of_the_picture_before_the_shift() -> None:
    pose = Pose(shift_px=(3.0, 0.0), turn_rad=math.radians(180))
    assert _seen(pose, 3.0, 0.0) == pytest.approx((0.0, 0.0), abs=EXACT)


def test_reversing_twice_gives_the_same_pose() -> None:
    pose = Pose(shift_px=(3.0, -4.0), turn_rad=0.2)
    there = pose.reversed(shift=True, turn=True)
    assert there == Pose(shift_px=(-3.0, 4.0), turn_rad=-0.2)
    assert there.reversed(shift=True, turn=True) == pose


def test_what_is_not_said_is_what_the_pictures_tell() -> None:
    first, second = poses_of(["1,-2", "0.5,3"], None, [0.0, 90.0])
    assert (first.shift_px, first.turn_rad) == ((1.0, -2.0), 0.0)
    assert (second.shift_px, second.turn_rad) == ((0.5, 3.0), math.pi / 2)
    assert poses_of(None, [45.0], [90.0])[0].turn_rad == pytest.approx(math.pi / 4)


def test_a_picture_to_be_turned_clockwise_holds_things_turned_the_other_way() -> None:
    assert [orientation_turn_deg(n) for n in (1, 3, 6, 8, 2)] == [0, 180, -90, 90, 0]


@pytest.mark.parametrize(
    ("shifts", "turns", "told"),
    [
        (["1,2"], None, "shift_px is given 1 times for 2 pictures"),
        (None, [1.0, 2.0, 3.0], "turn_deg is given 3 times"),
        (["1,2", "3"], None, "takes two numbers X,Y; got '3'"),
        (["1,2", "a,b"], None, "takes two numbers"),
        (["1,2", "nan,0"], None, "a shift is two numbers"),
        (["1,2", "inf,0"], None, "a shift is two numbers"),
        (None, [0.0, math.nan], "a turn is a number"),
    ],
)
def test_poses_that_are_none_are_refused(shifts: list, turns: list, told: str) -> None:
    with pytest.raises(ContractError, match=told):
        poses_of(shifts, turns, [0.0, 0.0])
