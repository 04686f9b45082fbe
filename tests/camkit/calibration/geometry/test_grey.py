"""Pictures of every kind as one grey plane."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from camkit.calibration.geometry.grey import read_grey, to_codes
from camkit.errors import DecodeError
from tests.camkit.calibration.point_factory import write_mosaic

EIGHT_BITS = 1 / 255


@pytest.fixture(name="codes")
def ramp() -> np.ndarray:
    y, x = np.mgrid[:60, :80]
    return ((x + y) * 255 // 138).astype(np.uint8)


def test_grey_colour_alpha_and_16_bit_are_read_alike(codes: np.ndarray, tmp_path: Path) -> None:
    kinds = {
        "grey.png": codes,
        "colour.png": np.stack([codes] * 3, axis=-1),
        "alpha.png": np.dstack([codes, codes, codes, np.full_like(codes, 7)]),
        "deep.png": codes.astype(np.uint16) * 257,
        "deep.tif": np.dstack([codes.astype(np.uint16) * 257] * 3),
    }
    read = []
    for name, samples in kinds.items():
        cv2.imwrite(str(tmp_path / name), samples)
        read.append(read_grey(tmp_path / name))
    for one in read:
        assert one.dtype == np.float32
        assert one.shape == codes.shape
        np.testing.assert_allclose(one, read[0], atol=EIGHT_BITS)


def test_a_mosaic_shows_no_pattern_of_colours_and_is_not_moved(tmp_path: Path) -> None:
    x = np.arange(64.0)
    light = 0.2 + 0.5 / (1 + np.exp(-(x - 31.5) * 2))
    colours = np.ones((64, 64))
    colours[::2, ::2], colours[1::2, 1::2] = 0.5, 0.7
    write_mosaic(tmp_path / "a.dng", light * colours, 1.0)
    seen = np.square(read_grey(tmp_path / "a.dng").astype(np.float64))
    flat = seen[4:-4, 4:20]
    assert np.ptp(flat) < 2e-3
    rows = seen[4:-4].mean(axis=0)
    middle = (rows[4] + rows[-5]) / 2
    assert np.interp(middle, rows[25:39], np.arange(25, 39)) == pytest.approx(31.5, abs=0.02)


def test_codes_spread_a_faint_picture(codes: np.ndarray) -> None:
    faint = codes.astype(np.float32) * 1e-3 + 0.4
    spread = to_codes(faint)
    assert (spread.min(), spread.max()) == (0, 255)
    assert to_codes(np.full((50, 50), 0.3, np.float32)).dtype == np.uint8


@pytest.mark.parametrize(
    ("name", "content"),
    [("empty.png", b""), ("text.jpg", b"no picture"), ("cut.jpg", b"\xff\xd8\xff\xe0\x00\x10JFIF"),
     ("noise.dng", b"II*\x00" + bytes(60)), ("none.bin", bytes(100))],
)  # fmt: skip
def test_what_is_no_picture_is_refused_by_name(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DecodeError, match=name):
        read_grey(tmp_path / name)


def test_folders_and_pipes_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    for path in (tmp_path, tmp_path / "pipe.png", tmp_path / "absent.png"):
        with pytest.raises(DecodeError, match=path.name):
            read_grey(path)


def test_samples_that_are_no_numbers_are_refused(tmp_path: Path) -> None:
    tifffile.imwrite(
        tmp_path / "nan.tif", np.full((64, 64, 3), np.nan, np.float32), photometric="rgb"
    )
    with pytest.raises(DecodeError, match="NaN"):
        read_grey(tmp_path / "nan.tif")


def test_a_picture_of_few_pixels_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "tiny.png"), np.zeros((20, 300, 3), np.uint8))
    with pytest.raises(DecodeError, match="300x20 px are too few"):
        read_grey(tmp_path / "tiny.png")
