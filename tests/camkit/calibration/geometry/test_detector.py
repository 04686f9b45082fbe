"""Corners where they are: sharp, blurred, faint, large, and none where there is no board."""

import cv2
import numpy as np
import pytest

from camkit.calibration.geometry.blur import blur_px
from camkit.calibration.geometry.board import Board
from camkit.calibration.geometry.camera_model import MODELS, Camera, FloatGrid, project
from camkit.calibration.geometry.detector import find_corners, nearest_px, refine
from camkit.calibration.geometry.saddle import refine_saddles
from tests.camkit.calibration.geometry.board_factory import (
    BOARD,
    Shot,
    camera_of,
    photograph,
    poses_around,
)

SHARP_RMS_PX = 0.12
BLURRED_RMS_PX = 0.15
NOISY_RMS_PX = 0.2
BLUR = 0.2
"""Of the sigma: the square root of light rises a little slower than light."""


def _grey(camera: Camera, pose: FloatGrid, shot: Shot) -> np.ndarray:
    return np.sqrt(photograph(camera, pose, shot) / np.float32(65535))


def _error_px(found: FloatGrid | None, camera: Camera, pose: FloatGrid) -> float:
    assert found is not None
    true = project(camera, pose, BOARD.points)[0]
    return min(float(np.sqrt(np.square(found - way).sum(-1).mean())) for way in (true, true[::-1]))


@pytest.mark.parametrize(
    ("shot", "limit_px"),
    [
        (Shot(), SHARP_RMS_PX),
        (Shot(noise=0.0), SHARP_RMS_PX),
        (Shot(blur_px=4, dark=0.35, bright=0.65), BLURRED_RMS_PX),
        (Shot(noise=0.02, dark=0.35, bright=0.65), NOISY_RMS_PX),
    ],
    ids=["sharp", "without noise", "blurred and faint", "noisy and faint"],
)
def test_corners_are_found_where_they_are(barrel: Camera, shot: Shot, limit_px: float) -> None:
    for pose in poses_around(barrel, shot.size, 3):
        assert _error_px(find_corners(_grey(barrel, pose, shot), BOARD), barrel, pose) < limit_px


def test_wide_angles_are_found() -> None:
    camera, shot = camera_of(MODELS[4], 185, (204.5, 153.0), 0.03, -0.01, 0, 0), Shot()
    for pose in poses_around(camera, shot.size, 4):
        assert (
            _error_px(find_corners(_grey(camera, pose, shot), BOARD), camera, pose) < SHARP_RMS_PX
        )


def test_a_large_picture_is_searched_small_and_measured_whole(barrel: Camera) -> None:
    numbers = np.array([*barrel.intrinsics[:3] * 5, *barrel.intrinsics[3:]])
    camera = Camera(model=barrel.model, intrinsics=numbers)
    pose = poses_around(barrel, (400, 300), 1)[0]
    shot = Shot(size=(2000, 1500), blur_px=9, dark=0.35, bright=0.65, fine=1)
    assert _error_px(find_corners(_grey(camera, pose, shot), BOARD), camera, pose) < BLURRED_RMS_PX


@pytest.mark.parametrize("blur", [1.5, 3.0, 5.0])
def test_blur_is_estimated(barrel: Camera, blur: float) -> None:
    pose = poses_around(barrel, (400, 300), 1)[0]
    grey = _grey(barrel, pose, Shot(blur_px=blur))
    true = project(barrel, pose, BOARD.points)[0]
    pixels = np.sqrt(1 / 12)
    assert blur_px(grey, true, BOARD) == pytest.approx(np.hypot(blur, pixels), rel=BLUR)


def test_a_saddle_is_found_from_aside(barrel: Camera) -> None:
    pose = poses_around(barrel, (400, 300), 1)[0]
    grey = _grey(barrel, pose, Shot(blur_px=4))
    true = project(barrel, pose, BOARD.points)[0]
    found = refine_saddles(grey, true + np.array([1.5, -1.0]), 6.0)
    assert _error_px(found, barrel, pose) < BLURRED_RMS_PX


def test_where_there_is_no_saddle_there_is_no_corner() -> None:
    flat = np.full((60, 60), 0.5, np.float32)
    assert np.isnan(refine_saddles(flat, np.array([[30.0, 30.0]]), 4.0)).all()


@pytest.mark.parametrize("board", [Board(columns=9, rows=6), Board(columns=7, rows=7)])  # fmt: skip
def test_a_board_of_another_size_is_not_found(barrel: Camera, board: Board) -> None:
    pose = poses_around(barrel, (400, 300), 1)[0]
    assert find_corners(_grey(barrel, pose, Shot()), board) is None


def test_there_is_no_board_in_noise_or_in_nothing() -> None:
    noise = np.random.default_rng(0).random((200, 240), dtype=np.float32)
    for grey in (noise, np.zeros_like(noise), np.full_like(noise, 0.7)):
        assert find_corners(grey, BOARD) is None


def test_the_way_to_the_nearest_corner_is_along_the_board() -> None:
    points = Board(columns=3, rows=3).points[:, :2] * [10, 4]
    assert nearest_px(points, Board(columns=3, rows=3)) == pytest.approx([4] * 9)


def test_corners_outside_the_picture_or_without_an_edge_are_none(barrel: Camera) -> None:
    pose = poses_around(barrel, (400, 300), 1)[0]
    grey = _grey(barrel, pose, Shot())
    true = project(barrel, pose, BOARD.points)[0]
    assert refine(grey, true, BOARD) is not None
    assert refine(grey, true - true.min(axis=0) - 3, BOARD) is None
    assert refine(np.full_like(grey, 0.5), true, BOARD) is None
    assert refine(1 - cv2.GaussianBlur(grey, (0, 0), 25), true, BOARD) is None


def test_corners_next_to_each_other_are_not_refined() -> None:
    points = BOARD.points[:, :2] * 3 + 20
    assert refine(np.zeros((80, 80), np.float32), points, BOARD) is None


def test_an_occluded_board_is_not_found(barrel: Camera) -> None:
    pose = poses_around(barrel, (400, 300), 1)[0]
    grey = _grey(barrel, pose, Shot())
    x, y = project(barrel, pose, BOARD.points)[0][17].astype(int)
    covered = cv2.rectangle(grey.copy(), (x - 40, y - 40), (x + 40, y + 40), 0.9, -1)
    assert find_corners(covered, BOARD) is None
