from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageCms

from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError, DecodeError
from camkit.models_def.training.pictures import (
    DrawnShares,
    list_pictures,
    open_source,
    read_picture,
    to_linear,
)


@pytest.fixture
def folder(tmp_path):
    rng = np.random.default_rng(0)
    for name, shape in (("b.png", (80, 120, 3)), ("a.png", (50, 40, 3))):
        cv2.imwrite(str(tmp_path / name), rng.integers(0, 256, shape, dtype=np.uint8))
    (tmp_path / "README.md").write_text("no picture", encoding="utf-8")
    return tmp_path


def test_pictures_are_listed_by_name_and_nothing_else(folder):
    assert [p.name for p in list_pictures(folder)] == ["a.png", "b.png"]
    assert list_pictures(None) == ()


def test_red_comes_first(tmp_path):
    cv2.imwrite(str(tmp_path / "red.png"), np.full((4, 4, 3), (0, 0, 255), np.uint8))
    linear = to_linear(read_picture(tmp_path / "red.png"))
    assert linear.shape == (3, 4, 4)
    assert np.allclose(linear[:, 0, 0], [1, 0, 0])


PATCHES = np.random.default_rng(1).integers(20, 236, (6, 8, 3), dtype=np.uint8)


def _profile(primaries, gamma: float) -> bytes:
    """Return a matrix profile, made from XYZ of the primaries at D50 by LittleCMS's own sRGB."""
    made = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    count = int.from_bytes(made[128:132], "big")
    for entry in range(132, 132 + 12 * count, 12):
        tag, at = bytes(made[entry : entry + 4]), int.from_bytes(made[entry + 4 : entry + 8], "big")
        if tag in (b"rXYZ", b"gXYZ", b"bXYZ"):
            numbers = primaries["rgb".index(chr(tag[0]))]
            made[at + 8 : at + 20] = b"".join(
                round(number * 65536).to_bytes(4, "big") for number in numbers
            )
        if tag in (b"rTRC", b"gTRC", b"bTRC"):
            curve = b"para" + bytes(4) + bytes(4) + round(gamma * 65536).to_bytes(4, "big")
            made[at : at + 16] = curve
        if tag == b"desc":
            made[at + 28 : at + 32] = "wi".encode("utf-16-be")
    return bytes(made)


WIDE = ((0.6097, 0.3111, 0.0195), (0.2053, 0.6257, 0.0609), (0.1492, 0.0632, 0.7446))
"""Adobe RGB (1998) at D50, as its specification states it."""
NARROW = ((0.4361, 0.2225, 0.0139), (0.3851, 0.7169, 0.0971), (0.1431, 0.0606, 0.7141))
"""Rec.709 likewise."""


@pytest.mark.parametrize("ending", ["png", "tif", "jpg"])
@pytest.mark.parametrize(("primaries", "gamma"), [(WIDE, 2.2), (WIDE, 1.8), (NARROW, 1.0)])
def test_the_profile_of_a_picture_is_applied(tmp_path, ending, primaries, gamma):
    path = tmp_path / f"a.{ending}"
    codes = PATCHES.repeat(16, axis=0).repeat(16, axis=1)
    options = {"quality": 100, "subsampling": 0} if ending == "jpg" else {}
    Image.fromarray(codes).save(path, icc_profile=_profile(primaries, gamma), **options)
    matrix = np.linalg.inv(np.transpose(NARROW)) @ np.transpose(primaries)
    wanted = np.clip((PATCHES / 255.0) ** gamma @ matrix.T, 0, 1)
    found = to_linear(read_picture(path)).transpose(1, 2, 0)[8::16, 8::16]
    assert np.abs(np.sqrt(found) - np.sqrt(wanted)).max() < (0.05 if ending == "jpg" else 0.02)


def test_a_picture_that_says_srgb_or_nothing_keeps_its_codes(tmp_path):
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    for number, profile in enumerate((None, srgb)):
        path = tmp_path / f"{number}.png"
        Image.fromarray(PATCHES).save(path, icc_profile=profile)
        assert np.array_equal(read_picture(path), PATCHES)


@pytest.mark.parametrize("profile", [b"no profile", b"x" * 200, bytes(128)])
def test_a_profile_that_is_none_is_refused_by_name(tmp_path, profile):
    Image.fromarray(PATCHES).save(tmp_path / "a.png", icc_profile=profile)
    with pytest.raises(DecodeError, match=r"a\.png has a colour profile that cannot be applied"):
        read_picture(tmp_path / "a.png")


def test_8_bit_values_are_decoded_by_the_srgb_curve():
    values = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    expected = decode_srgb(values.astype(np.float32) / 255).transpose(2, 0, 1)
    assert np.allclose(to_linear(values), expected, atol=1e-7)


def test_scenes_behind_the_first_ones_are_others():
    def drawn_shares(**first):
        source = open_source(None, picture_share=0.0, scenes=2, scene_px=32, **first)
        return {float(source.draw_crop(np.random.default_rng(i), 32).sum()) for i in range(8)}

    assert drawn_shares() == drawn_shares(first_scene=0)
    assert len(drawn_shares()) == 2
    assert not drawn_shares() & drawn_shares(first_scene=-2)


@pytest.mark.parametrize("side", [16, 64, 200])
def test_crops_have_the_asked_size_even_of_smaller_pictures(folder, side):
    source = open_source(folder, picture_share=1.0, scenes=1, scene_px=64)
    crop = source.draw_crop(np.random.default_rng(1), side)
    assert crop.shape == (3, side, side)
    assert crop.dtype == np.float32
    assert 0 <= crop.min() <= crop.max() <= 1


def test_crops_follow_from_the_generator_alone(folder):
    draws = []
    for _ in range(2):
        source = open_source(folder, picture_share=0.5, scenes=2, scene_px=96)
        rng = np.random.default_rng(7)
        draws.append([source.draw_crop(rng, 32) for _ in range(6)])
    assert all(np.array_equal(a, b) for a, b in zip(*draws, strict=True))


def test_without_a_folder_crops_are_procedural():
    source = open_source(None, picture_share=1.0, scenes=1, scene_px=96)
    crop = source.draw_crop(np.random.default_rng(0), 48)
    assert crop.shape == (3, 48, 48)
    assert crop.std() > 0


def test_missing_empty_and_broken_sources_are_refused(tmp_path):
    with pytest.raises(ContractError, match="is not there"):
        list_pictures(tmp_path / "none")
    with pytest.raises(ContractError, match="holds no picture"):
        list_pictures(tmp_path)
    (tmp_path / "x.png").write_bytes(b"not a picture")
    (tmp_path / "empty.png").write_bytes(b"")
    for name in ("x.png", "empty.png"):
        with pytest.raises(DecodeError, match="cannot be decoded"):
            read_picture(tmp_path / name)


def test_a_source_draws_edges_and_nights_as_often_as_it_is_told() -> None:
    def drawn_shares(shares: DrawnShares) -> list[np.ndarray]:
        source = open_source(None, picture_share=0, scenes=2, scene_px=96, drawn_shares=shares)
        rng = np.random.default_rng(0)
        return [source.draw_crop(rng, 48) for _ in range(60)]

    flat = [
        np.median(np.abs(np.diff(crop[1]))) < 1e-6 for crop in drawn_shares(DrawnShares(edge=0.5))
    ]
    assert 15 < sum(flat) < 45
    assert not any(
        np.median(np.abs(np.diff(crop[1]))) < 1e-6 for crop in drawn_shares(DrawnShares())
    )
    dark = [np.median(crop) < 0.01 for crop in drawn_shares(DrawnShares(night=1.0))]
    assert np.mean(dark) > 0.5
    patches = drawn_shares(DrawnShares(patch=1.0))
    deepest = min(float((crop.min(axis=0) / crop.max(axis=0)).min()) for crop in patches)
    assert deepest < 0.05, "no deep primary among the patches"
    assert all(np.median(np.abs(np.diff(crop[1]))) < 1e-6 for crop in patches)


def test_lamps_are_put_into_as_many_crops_as_it_is_told(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((64, 64, 3), 90, np.uint8))
    source = open_source(
        tmp_path, picture_share=1, scenes=1, scene_px=64, drawn_shares=DrawnShares(lamp=0.5)
    )
    rng = np.random.default_rng(0)
    lit = [source.draw_crop(rng, 48).max() > 1 for _ in range(60)]
    assert 15 < sum(lit) < 45


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("most_px", [50, 10])
def test_pictures_of_any_size_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most_px: int
) -> None:
    grey = np.full((8, 10, 3), 90, np.uint8)
    cv2.imwrite(str(tmp_path / "large.png"), grey)
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", most_px)
    assert np.array_equal(read_picture(tmp_path / "large.png"), grey)
