"""A picture is laid over its capture to a tenth of a pixel, however blurred and faint it is."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from scipy import ndimage

from camkit.calibration.display.alignment import Patch, align, map_places
from camkit.calibration.display.camera_file import Lens
from camkit.calibration.display.marks import find_marks
from camkit.calibration.display.screen import Screen
from camkit.calibration.display.targets import Target, Targets, draw_target
from camkit.calibration.display.tiles import tile_shifts
from camkit.calibration.display.view import read_view
from camkit.calibration.geometry.board import Board
from camkit.errors import DecodeError
from camkit.scenes import procedural_scene
from tests.camkit.calibration.display.screen_factory import DARK, Booth, luminance

PLACED_PX = 0.1
SEEN_PX = 0.02
"""Of a shift put in by hand."""
SCREEN = Screen(width_px=960, height_px=540)
TARGET = Target(
    file="a.png", name="a", kind="picture", code=9, place_px=SCREEN.place(1.5), source=("a", "sRGB")
)


def shown_of(seed):
    targets = Targets(screen=SCREEN, board=Board(columns=9, rows=6), targets=())
    return draw_target(targets, TARGET, np.clip(procedural_scene(seed, 400, 600), 0, 1))


@dataclass
class Laid:
    """A capture, its picture, and where it truly lies."""

    patch: Patch
    shown: np.ndarray
    start: np.ndarray
    true: np.ndarray

    def error_px(self, to_picture):
        height, width = self.shown.shape[1:]
        at = np.meshgrid(np.linspace(0, width - 1, 9), np.linspace(0, height - 1, 7))
        at = np.stack(at, axis=-1).reshape(-1, 2)
        gap = map_places(np.linalg.inv(to_picture), at) - map_places(self.true, at)
        return np.linalg.norm(gap, axis=1).max()


def capture_of(tmp_path, booth, seed=3):
    codes = shown_of(seed)
    lens = Lens.read(booth.write_geometry(tmp_path / "g.toml"))
    view, _ = read_view(booth.write(tmp_path / "c.dng", codes), lens)
    marks = find_marks(np.sqrt(np.maximum(view.grey, 0)))
    seen = np.concatenate([view.places(at) for at in marks.corners.values()])
    wanted = np.concatenate([SCREEN.corners[n] for n in marks.corners])
    x, y, width, height = TARGET.place_px
    to_place = np.array([[1, 0, -x], [0, 1, -y], [0, 0, 1.0]])
    start = to_place @ cv2.findHomography(lens.without_distortion(seen), wanted)[0]
    box = (0, 0, view.grey.shape[1], view.grey.shape[0])
    patch = Patch(grey=view.grey, usable=~view.clipped, ideal_px=view.window(lens, box))
    light = (luminance(codes[y : y + height, x : x + width]) - DARK).transpose(2, 0, 1)
    return Laid(
        patch=patch,
        shown=np.ascontiguousarray(light, dtype=np.float32),
        start=start,
        true=booth.homography @ np.linalg.inv(to_place),
    )


# 6 px in a capture of 3000 px are 1.2 px in one of 600
@pytest.mark.parametrize("seed", [3, 8])
@pytest.mark.parametrize("fault", ["sharp", "blurred and faint"])
def test_pictures_are_laid_to_a_tenth_of_a_pixel(tmp_path, seed, fault):
    change = {"sharp": {"blur_px": 0.6}, "blurred and faint": {"blur_px": 1.2, "veil": 0.5}}[fault]
    booth = Booth(screen=(960, 540), corner=0.4, **change)
    laid = capture_of(tmp_path, booth, seed)
    found = align(laid.patch, laid.shown, laid.start)
    assert laid.error_px(found.to_picture) < PLACED_PX < laid.error_px(laid.start)
    _, shifts = tile_shifts(laid.patch.grey, found.model, found.inside)
    assert np.sqrt((shifts**2).sum(axis=1).mean()) < 2 * PLACED_PX


def test_tiles_see_a_shift_of_the_capture(tmp_path):
    booth = Booth(screen=(960, 540), noisy=False)
    laid = capture_of(tmp_path, booth)
    found = align(laid.patch, laid.shown, laid.start)
    # not by OpenCV, which knows 32 places between two pixels
    model = ndimage.shift(found.model, (-0.2, 0.3), order=5, mode="nearest")
    _, shifts = tile_shifts(found.model.astype(np.float32), model, found.inside)
    assert np.median(shifts, axis=0) == pytest.approx([-0.3, 0.2], abs=SEEN_PX)


def test_another_picture_or_a_plain_one_is_refused(tmp_path):
    laid = capture_of(tmp_path, Booth(screen=(960, 540)))
    with pytest.raises(DecodeError, match="correlate by"):
        align(laid.patch, np.ascontiguousarray(laid.shown[:, ::-1]), laid.start)
    with pytest.raises(DecodeError, match=r"correlate by|too plain"):
        align(laid.patch, np.full_like(laid.shown, 0.5), laid.start)
    dark = Patch(
        grey=laid.patch.grey,
        usable=np.zeros_like(laid.patch.usable),
        ideal_px=laid.patch.ideal_px,
    )
    with pytest.raises(DecodeError, match="0 samples of the picture are seen"):
        align(dark, laid.shown, laid.start)
