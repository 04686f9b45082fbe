"""Codes of developed pictures become light by sRGB, by nothing, or by a measured curve."""

import re

import cv2
import numpy as np
import pytest
import tifffile

from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError, DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.raw import read_capture
from camkit.runtime.signal.tone_curve import Tone, read_tone
from tests.dng_factory import write_scene

CURVE = "levels = [0.0, 64.0, 128.0, 192.0, 255.0]\nluminance = [0.0, 0.03, 0.12, 0.4, 1.0]\n"
CODES = np.random.default_rng(1).integers(0, 256, (3, 9, 12)).astype(np.uint8)


@pytest.fixture
def curve(tmp_path):
    path = tmp_path / "maker.toml"
    path.write_text(CURVE)
    return path


def write(path, planes):
    if path.suffix == ".tif":
        tifffile.imwrite(path, planes.transpose(1, 2, 0), photometric="rgb")
    else:
        cv2.imwrite(str(path), planes[::-1].transpose(1, 2, 0))
    return path


def light(path, tone):
    return read_capture(path, tone=tone).linear_rows(0, 9)


def test_codes_of_8_bits_become_light_by_the_curve_that_is_chosen(tmp_path, curve):
    path = write(tmp_path / "x.png", CODES)
    assert np.array_equal(light(path, read_tone("srgb")), light(path, None))
    assert np.allclose(light(path, read_tone("linear")), CODES / 255, atol=1e-6)
    measured = read_tone(curve)
    assert np.allclose(light(path, measured), np.array(measured.light)[CODES], atol=1e-5)
    at = {0: 0.0, 64: 0.03, 128: 0.12, 192: 0.4, 255: 1.0}
    assert [measured.light[code] for code in at] == pytest.approx(list(at.values()), abs=1e-9)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_16_bits_are_coded_too_where_the_caller_says_so(tmp_path, curve, suffix):
    codes = CODES.astype(np.uint16) * 257
    path = write(tmp_path / f"x{suffix}", codes)
    expected = decode_srgb(CODES / np.float32(255))
    assert np.allclose(light(path, read_tone("srgb")), expected, atol=1e-5)
    assert np.array_equal(light(path, read_tone("linear")), light(path, None))
    measured = read_tone(curve)
    assert np.allclose(light(path, measured), np.array(measured.light)[CODES], atol=1e-5)


def test_a_curve_rises_between_its_256_levels(tmp_path, curve):
    ramp = np.broadcast_to(np.arange(0, 65536, 64, dtype=np.uint16), (3, 9, 1024))
    rows = light(write(tmp_path / "x.tif", ramp), read_tone(curve))[0, 0]
    assert (np.diff(rows) >= 0).all()
    assert len(np.unique(rows[256:])) == 768, "finer than 8 bits"


def test_floats_are_light_and_have_no_curve(tmp_path, curve):
    path = tmp_path / "x.tif"
    tifffile.imwrite(path, np.full((9, 9, 3), 0.5, np.float32), photometric="rgb")
    assert np.array_equal(light(path, read_tone("linear")), light(path, None))
    for tone in (read_tone("srgb"), read_tone(curve)):
        with pytest.raises(DecodeError, match="are light and not codes; leave tone out"):
            light(path, tone)


def test_raw_files_and_mosaics_have_no_curve(tmp_path):
    path = tmp_path / "x.dng"
    write_scene(path)
    mosaic = tmp_path / "m.png"
    cv2.imwrite(str(mosaic), np.full((8, 8), 500, np.uint16))
    options = MosaicOptions(cfa="RGGB", black_level=0, white_level=1023)
    for file, said in ((path, None), (mosaic, options)):
        text = re.escape(f"{file.name} holds the sensor's own light")
        with pytest.raises(ContractError, match=text):
            read_capture(file, mosaic=said, tone=read_tone("srgb"))


@pytest.mark.parametrize("text", ["", "levels = [0, 255]", CURVE.replace("255.0", "250.0")])
def test_what_is_no_curve_is_refused(tmp_path, text):
    path = tmp_path / "x.toml"
    path.write_text(text)
    with pytest.raises(ContractError, match=r"tone takes srgb, linear or a file .*x\.toml"):
        read_tone(path)


def test_a_name_that_is_no_curve_is_refused_with_those_that_are():
    with pytest.raises(ContractError, match=r"tone takes srgb, linear or a file .*adobe"):
        read_tone("adobe")


def test_a_curve_is_named_by_what_it_holds(curve):
    assert read_tone("srgb").to_json() == {"name": "srgb"}
    first = read_tone(curve).to_json()
    curve.write_text(CURVE.replace("0.12", "0.13"))
    second = read_tone(curve).to_json()
    assert first["name"] == second["name"] == "maker.toml"
    assert first["sha256"] != second["sha256"]
    assert read_tone("linear").is_linear
    assert not Tone(name="linear", light=(0.0, 1.0)).is_linear, "a file of that name"


def test_rounding_of_8_bits_has_the_variance_of_its_steps(tmp_path):
    path = write(tmp_path / "x.png", CODES)
    levels, variances = read_capture(path, tone=read_tone("linear")).rounding
    assert np.allclose(variances, 1 / 255**2 / 12, rtol=1e-4)
    assert levels[0] == pytest.approx(0.5 / 255, rel=1e-4)
    deep = write(tmp_path / "x.tif", CODES.astype(np.uint16) * 257)
    assert read_capture(deep).rounding is None
