"""A picture becomes the light of green in blocks."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.calibration.flat.picture import green_of, read_flat
from camkit.errors import DecodeError
from camkit.runtime.capture import Capture, MosaicOptions


def test_both_greens_of_a_cell_are_one_sample_and_red_and_blue_are_not() -> None:
    mosaic = np.tile(np.array([[9, 400], [600, 8]], dtype=np.uint16), (5, 6))
    capture = Capture(
        samples=mosaic, cfa="RGGB", black_level=np.zeros((2, 2), np.float32), white_level=1000.0
    )
    light, clipped, cell = green_of(capture)
    assert (light.shape, cell) == ((5, 6), 2)
    assert light == pytest.approx(0.5)
    assert not clipped.any()


def test_blocks_lie_where_their_pixels_are_and_dust_does_not_count(tmp_path: Path) -> None:
    plane = np.tile(np.arange(1000, 1000 + 128 * 100, 100, dtype=np.uint16), (96, 1))
    dusty = plane.copy()
    dusty[5, 5] = 65000
    files = []
    for name, codes in (("clean", plane), ("dusty", dusty)):
        files.append(tmp_path / f"{name}.png")
        assert cv2.imwrite(str(files[-1]), np.stack([codes] * 3, axis=-1))
    clean, dusty_seen = (read_flat(path, None) for path in files)
    assert clean.light * 65535 == pytest.approx(np.tile(1000 + 100 * clean.x_px, (24, 1)))
    assert dusty_seen.light == pytest.approx(clean.light, rel=0.1)
    assert clean.x_px[:2].tolist() == [1.5, 5.5]


@pytest.mark.parametrize(
    ("codes", "told"),
    [
        (np.full((96, 96), 65535, np.uint16), r"100\.0% of green is clipped; expose less"),
        (np.full((96, 96), 20, np.uint16), "is black in places"),
        (np.full((24, 96), 9000, np.uint16), "has 96x24 pixels; a flat needs 8 blocks of 4"),
        (np.full((96, 96), 90, np.uint8), "is coded in 8 bits"),
    ],
)
def test_pictures_that_tell_nothing_are_refused(tmp_path: Path, codes: np.ndarray, told: str) -> None:  # noqa: E501 # fmt: skip
    path = tmp_path / "a.png"
    assert cv2.imwrite(str(path), np.stack([codes] * 3, axis=-1))
    with pytest.raises(DecodeError, match=told):
        read_flat(path, None)


def test_a_border_that_the_display_does_not_reach_is_black(tmp_path: Path) -> None:
    codes = np.full((96, 96), 2000, np.uint16)
    codes[:, :20] = 256
    path = tmp_path / "a.png"
    assert cv2.imwrite(str(path), codes)
    with pytest.raises(DecodeError, match="is black in places"):
        read_flat(path, MosaicOptions(cfa="RGGB", black_level=256.0, white_level=4095.0))
