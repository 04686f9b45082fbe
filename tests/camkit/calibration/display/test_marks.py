"""Marks say which target a screen shows, however blurred, faint, dark or turned they are."""

import cv2
import numpy as np
import pytest

from camkit.calibration.display.marks import NUMBERS, find_marks
from camkit.calibration.display.screen import Screen
from camkit.calibration.display.targets import Target, Targets, draw_target
from camkit.calibration.geometry.board import Board

SCREEN = Screen(width_px=960, height_px=540)
CORNER_PX = 2.5
"""Of a picture of 600 px, blurred by 1.2 px: blur draws corners inwards, all alike."""


def screen_of(code, rgb=(128, 30, 90)):
    target = Target(
        file="x.png", name="x", kind="colour", rgb=rgb, code=code, place_px=SCREEN.place(1.5)
    )
    return draw_target(Targets(screen=SCREEN, board=Board(columns=9, rows=6), targets=()), target)


def seen(booth, code):
    return np.sqrt(booth.planes(screen_of(code)).mean(axis=0)).astype(np.float32)


# 6 px in a capture of 3000 px are 1.2 px in one of 600
@pytest.mark.parametrize(
    ("code", "turn_deg"), [(0, 181), (7, 2), (431, 90), (NUMBERS - 1, 2), (NUMBERS - 1, 181)]
)
def test_numbers_survive_strong_blur_a_third_of_the_contrast_and_vignetting(
    booth_of, code, turn_deg
):
    booth = booth_of(SCREEN, blur_px=1.2, veil=0.5, corner=0.4, turn_deg=turn_deg)
    grey = seen(booth, code)
    grey += np.random.default_rng(code).normal(0, 0.005, grey.shape).astype(np.float32)
    found = find_marks(grey)
    assert found is not None
    assert found.number == code
    assert len(found.corners) == 4
    for number, corners in found.corners.items():
        wanted = booth.seen_at(SCREEN.corners[number])
        assert np.linalg.norm(corners - wanted, axis=1).max() < CORNER_PX


def test_one_hidden_block_does_no_harm_two_are_too_few(booth_of):
    screen = screen_of(5)
    side = SCREEN.blocks[2][1]
    screen[:200, :200] = 0
    booth = booth_of(SCREEN)
    grey = np.sqrt(booth.planes(screen).mean(axis=0)).astype(np.float32)
    found = find_marks(grey)
    assert found is not None
    assert (found.number, sorted(found.corners)) == (5, [1, 2, 3])
    screen[side:, :200] = 0
    assert find_marks(np.sqrt(booth.planes(screen).mean(axis=0)).astype(np.float32)) is None


def test_blocks_that_disagree_are_no_marks(booth_of):
    screen, other = screen_of(5), screen_of(6)
    screen[:, 480:] = other[:, 480:]
    booth = booth_of(SCREEN)
    assert find_marks(np.sqrt(booth.planes(screen).mean(axis=0)).astype(np.float32)) is None


@pytest.mark.parametrize("picture", ["noise", "even", "board"])
def test_pictures_without_marks_have_none(picture):
    rng = np.random.default_rng(1)
    plane = {
        "noise": rng.random((300, 400)),
        "even": np.full((300, 400), 0.3),
        "board": np.kron(np.indices((10, 12)).sum(axis=0) % 2, np.ones((30, 30))),
    }[picture]
    assert find_marks(plane.astype(np.float32)) is None


def test_a_mirrored_screen_is_no_screen(booth_of):
    grey = seen(booth_of(SCREEN), 12)
    assert find_marks(np.ascontiguousarray(cv2.flip(grey, 1))) is None
