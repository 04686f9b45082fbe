"""A caption lies in the picture, and no picture lies under a caption."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tools.pictures.captions import GAP_PX, text_px, write_captioned

SIDE = 48
RNG = np.random.default_rng(1)
FIRST, SECOND, THIRD = (RNG.integers(0, 256, (3, SIDE, SIDE)) for _ in range(3))
ROWS = {
    "one": {"a": FIRST / np.float32(255), "b": SECOND / np.float32(255)},
    "two": {"c": THIRD / np.float32(255)},
}
LINE = 2 * text_px(SIDE)


def test_text_lies_above_the_pictures_which_keep_their_pixels(tmp_path: Path) -> None:
    write_captioned(tmp_path / "sheet.png", "camera\ndB", ROWS)
    page = cv2.imread(str(tmp_path / "sheet.png"))
    assert page is not None
    assert page.shape == (2 * LINE + 2 * (2 * LINE + SIDE), 2 * (SIDE + GAP_PX), 3)
    left, right = np.s_[:SIDE], np.s_[SIDE + GAP_PX : 2 * SIDE + GAP_PX]
    row = 4 * LINE + SIDE
    for top, columns, tile in (
        (4 * LINE, left, FIRST),
        (4 * LINE, right, SECOND),
        (row + 2 * LINE, left, THIRD),
    ):
        shown = page[top : top + SIDE, columns, ::-1].transpose(2, 0, 1)
        np.testing.assert_array_equal(shown, tile)
    lines = [0, LINE, 2 * LINE, 3 * LINE, row, row + LINE]
    assert all(page[top : top + LINE, left].min() < 100 for top in lines)
    assert page[3 * LINE : 4 * LINE, right].min() < 100
    assert page[row : row + 2 * LINE, right].min() == 255  # no picture, no caption


def test_text_grows_with_the_pictures() -> None:
    assert text_px(384) == 16
    assert text_px(768) == 32
    assert text_px(24) == 12


def test_a_picture_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "x.png").mkdir()
    with pytest.raises(OSError, match="cannot write"):
        write_captioned(tmp_path / "x.png", "camera", ROWS)
