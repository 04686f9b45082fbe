"""The alignment finds known homographies, and says so when it cannot."""

import cv2
import numpy as np
import pytest

from camkit.colorimetry import encode_srgb
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.fine_tuning import homography
from camkit.models_def.kinds.bayer.fine_tuning.homography import (
    find_homography,
    map_points,
    warp_to,
)
from camkit.scenes import procedural_scene

SIZE = (480, 360)
CORNERS = np.array([[x, y] for x in (0, 239.5, 479) for y in (0, 179.5, 359)], dtype=np.float64)


def matrix(turn_rad, scale, shift_px, keystone):
    c, s = scale * np.cos(turn_rad), scale * np.sin(turn_rad)
    return np.array([[c, -s, shift_px[0]], [s, c, shift_px[1]], [*keystone, 1]])


@pytest.fixture(scope="module")
def reference():
    return encode_srgb(procedural_scene(4, SIZE[1], SIZE[0])).mean(0)


def photograph(reference, true, *, blur_px=0.0, noise=0.0):
    capture = cv2.warpPerspective(reference, true, SIZE, flags=cv2.INTER_LANCZOS4, borderValue=0.2)
    if blur_px:
        capture = cv2.GaussianBlur(capture, (0, 0), blur_px)
    grain = noise * np.random.default_rng(0).standard_normal(capture.shape)
    return (0.7 * capture + 0.05 + grain).astype(np.float32)


@pytest.mark.parametrize(
    ("true", "blur_px", "noise"),
    [
        (matrix(0.0, 1.0, (0.0, 0.0), (0, 0)), 0.0, 0.0),
        (matrix(0.05, 0.9, (40, 10), (2e-5, -3e-5)), 0.0, 0.0),
        (matrix(-0.1, 1.1, (-7.3, 21.6), (-4e-5, 6e-5)), 1.0, 0.005),
        (matrix(0.02, 0.8, (50.5, 33.25), (1e-4, 0)), 1.5, 0.005),
    ],
)
def test_known_homographies_are_found_to_a_tenth_of_a_pixel(reference, true, blur_px, noise):
    found = find_homography(reference, photograph(reference, true, blur_px=blur_px, noise=noise))
    gap = map_points(found.matrix, CORNERS) - map_points(true, CORNERS)
    assert np.linalg.norm(gap, axis=1).max() < 0.1
    assert found.inliers > 0.8 * found.matches
    assert found.correlation > 0.95


def test_large_pictures_are_matched_small_and_mapped_at_full_size(reference, monkeypatch):
    monkeypatch.setattr(homography, "WORK_SIDE_PX", 600)
    large = cv2.resize(reference, None, fx=3, fy=3, interpolation=cv2.INTER_CUBIC)
    found = find_homography(large, reference)
    # Pixel centres: 3 x + 1 in the large picture is x in the small one.
    gap = map_points(found.matrix, 3 * CORNERS + 1) - CORNERS
    assert np.linalg.norm(gap, axis=1).max() < 0.1


def test_too_few_features_are_an_error(reference):
    with pytest.raises(ContractError, match="too few features were found"):
        find_homography(reference, np.full_like(reference, 0.5))


def test_another_picture_is_an_error(reference):
    other = encode_srgb(procedural_scene(9, SIZE[1], SIZE[0])).mean(0)
    with pytest.raises(ContractError, match=r"right pair|agree on one homography"):
        find_homography(reference, other)


def test_warping_by_whole_pixels_copies_and_marks_what_is_inside():
    picture = np.random.default_rng(1).random((3, 40, 50)).astype(np.float32)
    y, x = np.mgrid[0:40, 0:50].astype(np.float64)
    warped, inside = warp_to(picture, x + 3, y - 2)
    assert np.allclose(warped[:, 2:, :-3], picture[:, :-2, 3:], atol=1e-6)
    assert inside[6:38, 1:42].all()
    assert not inside[:6].any()
    assert not inside[:, 43:].any()
