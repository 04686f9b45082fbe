"""Models whose distortion folds are not taken."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.calibration.geometry.camera_model import MODELS, Camera, FloatGrid, project
from camkit.calibration.geometry.choice import Judged, judge_all
from camkit.calibration.geometry.unfolded import MOST_FACTOR, unfolded
from camkit.errors import DecodeError
from tests.camkit.calibration.geometry.board_factory import BOARD, camera_of, poses_around

SIZE = (400, 300)
FOLD_PX = 340 * np.sqrt(1 / (3 * 0.45)) * 2 / 3
"""Of r (1 - 0.45 r^2), inside the picture, whose corner lies at 250 px."""


@pytest.fixture(scope="module")
def seen() -> tuple[FloatGrid, list[Judged]]:
    """Corners in the middle of the picture only."""
    camera = camera_of(MODELS[1], 340, (199.5, 149.5), -0.45)
    poses = poses_around(camera, SIZE, 8, seed=1, span=0.3, reach=0.3)
    corners = np.stack([project(camera, pose, BOARD.points)[0] for pose in poses])
    corners += np.random.default_rng(0).normal(0, 0.02, corners.shape)
    return corners, judge_all(corners, BOARD.points, SIZE)[0]


def test_a_model_that_folds_is_refused_and_says_where(
    seen: tuple[FloatGrid, list[Judged]],
) -> None:
    corners, judged = seen
    told = rf"radial_1\) folds back at {FOLD_PX:.0f} px .* whose corner lies at 250 px"
    with pytest.raises(DecodeError, match=told):
        unfolded(judged[:2], corners, SIZE)


def test_another_that_is_about_as_good_takes_its_place(
    seen: tuple[FloatGrid, list[Judged]],
) -> None:
    corners, (straight, folding, *_) = seen
    same = replace(straight, held_out=folding.held_out * 1.2)
    chosen, coverage, profile = unfolded([same, folding], corners, SIZE)
    assert chosen is same
    assert profile.fold_px >= coverage.corner_px
    with pytest.raises(DecodeError, match="folds back"):
        unfolded([replace(same, held_out=folding.held_out * 1.3), folding], corners, SIZE)


def test_coefficients_that_cancel_each_other_are_none_of_a_lens(
    seen: tuple[FloatGrid, list[Judged]],
) -> None:
    corners, (straight, *_) = seen
    # the same numbers above and below: no distortion at all, as straight lines have
    numbers = np.zeros(8)
    numbers[[0, 5]], numbers[[1, 6]] = 2e6, 1e6
    camera = Camera(
        model=MODELS[-1], intrinsics=np.append(straight.fit.camera.intrinsics[:3], numbers)
    )
    wild = replace(
        straight,
        fit=replace(straight.fit, camera=camera),
        held_out=straight.held_out * 0.9,
    )
    assert np.abs(camera.coefficients).max() > MOST_FACTOR
    chosen, *_ = unfolded([straight, wild], corners, SIZE)
    assert chosen is straight
    far_off = replace(straight, held_out=straight.held_out * 2)
    with pytest.raises(DecodeError, match=r"rational\) has coefficients that are none of a lens"):
        unfolded([far_off, wild], corners, SIZE)
