"""Patches: the same busy place of every method, as PNGs that decode to what was restored."""

import cv2
import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE
from camkit.colorimetry import decode_srgb, encode_srgb
from camkit.report.bench.accuracy import INPUT
from camkit.report.bench.crops import (
    SHARP,
    CropCollector,
    busiest_place,
    display_gain,
)
from camkit.report.bench.known_captures import KnownCapture
from camkit.report.figure import encode_png, levels_of


def decode(png: bytes) -> FloatArray:
    data = np.frombuffer(png, np.uint8)
    levels = cv2.imdecode(data, cv2.IMREAD_COLOR)
    return levels[..., ::-1].transpose(2, 0, 1).astype(np.float32) / 255


def make_capture(sharp: FloatArray, name: str = "a") -> KnownCapture:
    return KnownCapture(
        picture=name,
        caption=name,
        psf="bundle",
        capture=np.zeros((4, 4), np.uint16),
        iso=100,
        white_balance=None,
        origin_px=(0, 0),
        undistort=False,
        truths={IMAGE: sharp},
    )


def test_the_patch_lies_where_the_detail_is_and_inside_the_border() -> None:
    sharp = np.full((3, 300, 400), 0.5, np.float32)
    sharp[:, 170:260, 210:300] = np.random.default_rng(0).random((3, 90, 90))
    rows, columns = busiest_place(sharp)
    assert rows.stop - rows.start == columns.stop - columns.start == 128
    assert rows.start <= 170
    assert rows.stop >= 256
    assert columns.start <= 210
    assert columns.stop >= 300
    assert busiest_place(np.zeros((3, 100, 90), np.float32)) == (slice(32, 58), slice(32, 58))


def test_a_png_holds_the_values_in_eight_bits() -> None:
    values = np.random.default_rng(1).random((3, 20, 30), dtype=np.float32)
    np.testing.assert_allclose(decode(encode_png(levels_of(values))), values, atol=0.5 / 255 + 1e-6)


def test_every_method_shows_the_same_place_with_its_own_psnr() -> None:
    sharp = np.random.default_rng(2).random((3, 200, 220), dtype=np.float32)
    collector = CropCollector([("m",)])
    known = make_capture(sharp)
    for key, values in ((INPUT, sharp * 0.5), (("m",), sharp), (("other",), sharp)):
        collector.take(key, known, decode_srgb(values.astype(np.float32)))
    (patch,) = collector.patches
    assert set(patch.pictures) == {SHARP, INPUT, ("m",)}
    np.testing.assert_array_equal(decode(patch.pictures[SHARP]), decode(patch.pictures[("m",)]))
    inside = sharp[:, *busiest_place(sharp)]
    assert patch.psnr_db[INPUT] == pytest.approx(-10 * np.log10(np.mean(inside**2) / 4), abs=0.01)
    assert patch.psnr_db[("m",)] > 90


def test_every_nth_capture_is_kept() -> None:
    sharp = np.zeros((3, 200, 200), np.float32)
    collector = CropCollector([], every=3)
    for number in range(7):
        collector.take(INPUT, make_capture(sharp, str(number)), sharp)
    assert [patch.caption.split(",")[0] for patch in collector.patches] == ["0", "3", "6"]


def test_dark_patches_are_shown_brighter_and_judged_as_they_are() -> None:
    assert display_gain(np.full((3, 9, 9), 0.3, np.float32)) == 1
    assert display_gain(np.full((3, 9, 9), 0.02, np.float32)) == 20
    sharp = encode_srgb(np.full((3, 200, 200), 0.02, np.float32))
    collector = CropCollector([])
    collector.take(INPUT, make_capture(sharp), decode_srgb(sharp * np.float32(0.5)))
    (patch,) = collector.patches
    assert patch.caption == "a, shown 20 times brighter"
    assert decode(patch.pictures[SHARP]).mean() == pytest.approx(
        encode_srgb(np.full((3, 1, 1), 0.4, np.float32)).mean(), abs=0.01
    )
    assert patch.psnr_db[INPUT] == pytest.approx(-20 * np.log10(sharp.mean() / 2), abs=0.01)
