"""Pictures mean the light that their profile says, or are refused by the profile's name."""

import numpy as np
import pytest
from PIL import Image, ImageCms

from camkit.calibration.display.displayed_picture import read_shown
from camkit.colorimetry import D65, adapt_white, encode_srgb, rgb_to_xyz
from camkit.errors import DecodeError
from camkit.runtime.files.formats.color_space import ADOBE_RGB_GAMMA, ADOBE_RGB_PRIMARIES
from camkit.runtime.files.formats.icc_profile import PCS_WHITE
from camkit.runtime.output.icc import _assemble, _curve, _text, _xyz

HALF_CODE = 0.6 / 255
"""Rounding to 8 bits."""


def adobe_profile(title="Adobe RGB (1998)", gamma=ADOBE_RGB_GAMMA):
    colorants = adapt_white(D65, PCS_WHITE) @ rgb_to_xyz(ADOBE_RGB_PRIMARIES, D65)
    tags = [(b"desc", _text(title))]
    tags += [(name, _xyz(colorants[:, n])) for n, name in enumerate((b"rXYZ", b"gXYZ", b"bXYZ"))]
    tags += [(name, _curve((gamma,))) for name in (b"rTRC", b"gTRC", b"bTRC")]
    return _assemble(tags)


def write(path, codes, profile=None):
    Image.fromarray(codes).save(path, icc_profile=profile)
    return path


@pytest.fixture(name="light")
def light_inside_srgb():
    return np.random.default_rng(4).uniform(0.05, 0.95, (3, 20, 24)).astype(np.float32)


@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_adobe_rgb_becomes_the_light_it_was_made_of(tmp_path, light, suffix):
    to_adobe = np.linalg.inv(rgb_to_xyz(ADOBE_RGB_PRIMARIES, D65)) @ rgb_to_xyz(
        ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06)), D65
    )
    codes = np.tensordot(to_adobe, light, 1) ** (256 / 563)
    eight = np.rint(255 * codes).astype(np.uint8).transpose(1, 2, 0)
    found, space = read_shown(write(tmp_path / f"a.{suffix}", eight, adobe_profile()))
    assert space == "Adobe RGB"
    assert np.abs(encode_srgb(found) - encode_srgb(light)).max() < 4 * HALF_CODE


def test_srgb_is_known_with_and_without_its_profile(tmp_path, light):
    codes = np.rint(255 * encode_srgb(light)).astype(np.uint8).transpose(1, 2, 0)
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    for profile in (None, srgb):
        found, space = read_shown(write(tmp_path / "a.png", codes, profile))
        assert space == "sRGB"
        assert np.abs(encode_srgb(found) - encode_srgb(light)).max() < HALF_CODE


def test_other_profiles_are_honoured_by_name_and_damaged_ones_refused(tmp_path):
    codes = np.full((20, 20, 3), 128, np.uint8)
    own = adobe_profile("My own RGB", 1.8)
    found, space = read_shown(write(tmp_path / "a.png", codes, own))
    assert space == "My own RGB"
    assert np.abs(found - (128 / 255) ** 1.8).max() < 1e-3
    for cut in (90, 131, 160, 240):
        damaged = write(tmp_path / "b.png", codes, adobe_profile()[:cut])
        with pytest.raises(DecodeError, match=r"b\.png states a colour profile that is damaged"):
            read_shown(damaged)


@pytest.mark.parametrize("suffix", ["jpg", "png", "tif"])
@pytest.mark.parametrize("colours", [np.s_[:], 0], ids=["colour", "grey"])
def test_pictures_are_shown_upright_and_grey_ones_too(tmp_path, suffix, colours):
    codes = np.zeros((20, 40, 3), np.uint8)
    codes[:, :20] = 255
    exif = Image.Exif()
    exif[0x0112] = 6
    path = tmp_path / f"a.{suffix}"
    Image.fromarray(codes[..., colours]).save(path, exif=exif, quality=95)
    found, _ = read_shown(path)
    assert found.shape == (3, 40, 20)
    assert found[:, :15].min() > 0.9
    assert found[:, 25:].max() < 0.1
    assert read_shown(write(tmp_path / "g.png", codes[..., 0]))[0].shape == (3, 20, 40)


def test_what_is_no_picture_is_refused(tmp_path):
    with pytest.raises(DecodeError, match="too few to be shown"):
        read_shown(write(tmp_path / "a.png", np.zeros((4, 20, 3), np.uint8)))
    with pytest.raises(DecodeError, match=r"none\.png"):
        read_shown(tmp_path / "none.png")
    with pytest.raises(DecodeError, match="a folder, not a file"):
        read_shown(tmp_path)
