import struct
import sys

import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image

from camkit.colorimetry import ACES_WHITE, ACESCG_PRIMARIES, decode_srgb
from camkit.errors import DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files.formats.mapped_tiff import map_plain_tiff
from camkit.runtime.files.picture import read_light, read_mosaic, read_picture, read_scene
from camkit.runtime.metadata import Metadata
from camkit.runtime.raw import read_capture
from tests.data_folder import data_path

OPTIONS = MosaicOptions(cfa="GRBG", black_level=25, white_level=1023)


def planes_of(dtype, top=None, height=9, width=7):
    rng = np.random.default_rng(2)
    if top is None:
        return rng.normal(1, 2, (3, height, width)).astype(dtype)
    return rng.integers(0, top, (3, height, width), endpoint=True).astype(dtype)


def write_exr(path, planes, names="RGB", **header):
    channels = dict(zip(names, planes, strict=True))
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | header
    OpenEXR.File(header, channels).write(str(path))


def write_png(path, planes):
    bgr = planes[::-1].transpose(1, 2, 0) if planes.ndim == 3 else planes
    path.write_bytes(cv2.imencode(".png", np.ascontiguousarray(bgr))[1].tobytes())


def test_exr_keeps_highlights_and_negatives(tmp_path):
    planes = planes_of(np.float32) * 1000
    write_exr(tmp_path / "x.exr", planes)
    capture = read_capture(tmp_path / "x.exr")
    assert capture.contract == "linear_rgb_v1"
    assert np.array_equal(capture.linear_rows(0, 9), planes)
    assert np.array_equal(read_scene(tmp_path / "x.exr"), planes)
    assert len(capture.sha256) == 64


def test_luminance_exr_is_grey_and_alpha_is_dropped(tmp_path):
    planes = planes_of(np.float32)
    write_exr(tmp_path / "y.exr", planes[:1], "Y")
    assert np.array_equal(read_picture(tmp_path / "y.exr").samples, np.stack([planes[0]] * 3))
    write_exr(tmp_path / "a.exr", [*planes, planes[0]], "RGBA")
    assert read_picture(tmp_path / "a.exr").notes == ("alpha channel dropped",)


def test_exr_without_picture_channels_is_refused(tmp_path):
    write_exr(tmp_path / "x.exr", planes_of(np.float32)[:1], "Z")
    with pytest.raises(DecodeError, match=r"\['Z'\]"):
        read_picture(tmp_path / "x.exr")


def test_scene_in_acescg_is_converted_to_rec709(tmp_path):
    chromaticities = (*np.ravel(ACESCG_PRIMARIES).tolist(), *ACES_WHITE)
    grey = np.full((3, 4, 4), 0.5, dtype=np.float32)
    red = grey * np.array([1, 0.2, 0.2], dtype=np.float32)[:, None, None]
    for planes in (grey, red):
        write_exr(tmp_path / "x.exr", planes, chromaticities=chromaticities)
        scene = read_scene(tmp_path / "x.exr")
        if planes is grey:
            assert np.allclose(scene, 0.5, atol=1e-4)
        else:
            assert scene[0, 0, 0] > 0.6
    notes = read_picture(tmp_path / "x.exr").notes
    assert "not Rec.709" in notes[0]


def test_bad_samples_are_counted_in_a_capture_and_refused_in_a_scene(tmp_path):
    planes = planes_of(np.float32)
    planes[0, 0, :2] = np.nan, np.inf
    write_exr(tmp_path / "x.exr", planes)
    assert read_picture(tmp_path / "x.exr").notes == ("2 samples are NaN or infinite",)
    with pytest.raises(DecodeError, match="2 samples"):
        read_scene(tmp_path / "x.exr")


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_16_bit_is_linear_as_capture_and_srgb_as_scene(tmp_path, suffix):
    planes = planes_of(np.uint16, 65535)
    path = tmp_path / f"x{suffix}"
    if suffix == ".png":
        write_png(path, planes)
    else:
        tifffile.imwrite(path, planes.transpose(1, 2, 0), photometric="rgb")
    capture = read_capture(path)
    assert np.array_equal(capture.samples, planes)
    assert (capture.white_level, capture.notes) == (65535, ())
    assert np.allclose(read_scene(path), decode_srgb(planes / np.float32(65535)), atol=1e-6)


def test_8_bit_is_srgb_both_ways(tmp_path):
    planes = planes_of(np.uint8, 255)
    write_png(tmp_path / "x.png", planes)
    linear = decode_srgb(planes / np.float32(255))
    capture = read_capture(tmp_path / "x.png")
    assert np.abs(capture.linear_rows(0, 9) - linear).max() < 1e-5
    assert "sRGB" in capture.notes[0]
    assert capture.saturated_rows(0, 9).sum() == (planes >= 254).sum()
    assert np.allclose(read_scene(tmp_path / "x.png"), linear, atol=1e-6)


def test_float_tiff_is_linear(tmp_path):
    planes = planes_of(np.float32)
    tifffile.imwrite(tmp_path / "x.tif", planes.transpose(1, 2, 0), photometric="rgb")
    assert np.array_equal(read_picture(tmp_path / "x.tif").samples, planes)


def test_a_grey_jpeg_is_a_picture_and_no_mosaic(tmp_path):
    path = tmp_path / "grey.png"  # the content counts, not the name
    path.write_bytes(cv2.imencode(".jpg", np.full((8, 8), 90, np.uint8))[1].tobytes())
    with pytest.raises(DecodeError, match=r"grey\.png is a JPEG, which cannot be a mosaic"):
        read_mosaic(path, OPTIONS)
    capture = read_picture(path)
    assert np.abs(capture.linear_rows(0, 8) - decode_srgb(np.float32(90 / 255))).max() < 1e-5
    assert "MosaicOptions.cfa" not in " ".join(capture.notes)


def test_a_headerless_mosaic_needs_its_options_and_then_takes_them(tmp_path):
    mosaic = planes_of(np.uint16, 100)[0] + np.tile([[300, 800], [800, 500]], (5, 4))[:9, :7]
    mosaic = mosaic.astype(np.uint16)
    write_png(tmp_path / "x.png", mosaic)
    with pytest.raises(
        DecodeError, match=r"MosaicOptions.cfa=.RGGB. with MosaicOptions.black_level"
    ):
        read_capture(tmp_path / "x.png")
    capture = read_capture(tmp_path / "x.png", mosaic=OPTIONS)
    assert np.array_equal(capture.samples, mosaic)
    assert (capture.contract, capture.cfa) == ("raw_bayer_v1", "GRBG")
    assert (capture.black_level == 25).all()


def test_mosaic_options_that_contradict_the_file_are_refused(tmp_path):
    write_png(tmp_path / "rgb.png", planes_of(np.uint16, 1000))
    with pytest.raises(DecodeError, match="one 8- or 16-bit channel"):
        read_mosaic(tmp_path / "rgb.png", OPTIONS)
    write_png(tmp_path / "8.png", planes_of(np.uint8, 255)[0])
    with pytest.raises(DecodeError, match="levels"):
        read_mosaic(tmp_path / "8.png", OPTIONS)
    write_png(tmp_path / "16.png", planes_of(np.uint16, 60000)[0])
    with pytest.raises(DecodeError, match=r"MosaicOptions.white_level"):
        read_mosaic(tmp_path / "16.png", OPTIONS)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".jpg", ".hdr", ".exr"])
def test_truncated_pictures_are_refused(tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    planes = planes_of(np.float32, height=64, width=64)
    if suffix == ".exr":
        write_exr(path, planes)
    elif suffix == ".tif":
        tifffile.imwrite(path, np.abs(planes).transpose(1, 2, 0), photometric="rgb")
    else:
        dtype = np.float32 if suffix == ".hdr" else np.uint8
        bgr = np.abs(planes).transpose(1, 2, 0).astype(dtype)
        path.write_bytes(cv2.imencode(suffix, bgr)[1].tobytes())
    read_scene(path)
    data = path.read_bytes()
    for share in (0.9, 0.5, 0.0):
        path.write_bytes(data[: int(share * len(data))])
        with pytest.raises(DecodeError):
            read_scene(path)


def test_an_exr_that_claims_too_much_is_refused_before_it_is_read(tmp_path):
    write_exr(tmp_path / "x.exr", planes_of(np.float32))
    data = (tmp_path / "x.exr").read_bytes()
    window = np.array([0, 0, 6, 8], dtype="<i4").tobytes()
    huge = np.array([0, 0, 60000, 60000], dtype="<i4").tobytes()
    assert window in data
    (tmp_path / "x.exr").write_bytes(data.replace(window, huge))
    with pytest.raises(DecodeError):
        read_picture(tmp_path / "x.exr")


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_a_picture_that_claims_too_much_is_refused_before_it_is_decoded(tmp_path, suffix):
    data = bytearray(cv2.imencode(suffix, np.zeros((16, 16, 3), np.uint8))[1].tobytes())
    at = data.index(b"IHDR") + 4 if suffix == ".png" else data.index(b"\xff\xc0") + 5
    data[at : at + 8 if suffix == ".png" else at + 4] = (
        struct.pack(">II", 30_000, 30_000)
        if suffix == ".png"
        else struct.pack(">HH", 30_000, 30_000)
    )
    (tmp_path / f"x{suffix}").write_bytes(data)
    with pytest.raises(DecodeError, match="claims 30000x30000 pixels"):
        read_picture(tmp_path / f"x{suffix}")


def test_a_missing_scene_is_a_decode_error(tmp_path):
    with pytest.raises(DecodeError, match="cannot read"):
        read_scene(tmp_path / "none.png")


def test_what_is_wrong_with_a_scene_is_told_with_its_name(tmp_path):
    write_exr(tmp_path / "depth.exr", [np.ones((4, 4), np.float32)] * 2, ["Z", "ZBack"])
    with pytest.raises(DecodeError, match=r"depth\.exr: expected EXR channels R, G, B or Y"):
        read_scene(tmp_path / "depth.exr")
    (tmp_path / "no.png").write_bytes(b"no picture")
    with pytest.raises(DecodeError, match=r"no\.png: the picture is damaged"):
        read_scene(tmp_path / "no.png")


def test_faint_negatives_of_a_scene_are_dark_and_deep_ones_stay(tmp_path):
    planes = np.abs(planes_of(np.float32))
    planes[0, 0, 0], planes[1, 0, 0] = planes.max() * -0.009, planes.max()
    write_exr(tmp_path / "x.exr", planes)
    np.testing.assert_array_equal(read_light(tmp_path / "x.exr"), np.maximum(planes, 0))
    planes[0, 0, 0] = planes.max() * -0.02
    write_exr(tmp_path / "x.exr", planes)
    np.testing.assert_array_equal(read_light(tmp_path / "x.exr"), planes)
    write_exr(tmp_path / "x.exr", -np.abs(planes) - 1)
    assert read_light(tmp_path / "x.exr").max() < 0


def test_a_damaged_hdr_leaves_no_word_and_no_file(tmp_path, capfd, monkeypatch):
    monkeypatch.setenv("OPENCV_TEMP_PATH", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    path = tmp_path / "x.hdr"
    bgr = np.abs(planes_of(np.float32, height=64, width=64)).transpose(1, 2, 0)
    data = cv2.imencode(".hdr", bgr)[1].tobytes()
    for changed in (data[:-40], data.replace(b"+X 64", b"+X 60000").replace(b"-Y 64", b"-Y 60000")):
        path.write_bytes(changed)
        with pytest.raises(DecodeError):
            read_scene(path)
    assert capfd.readouterr() == ("", "")
    assert list((tmp_path / "temporary").iterdir()) == []


def test_damaged_exr_and_hdr_files_are_refused_and_stdout_stays_clean(capsys):
    stdout = sys.stdout
    for path in sorted(data_path("hdr/damaged").iterdir()):
        with pytest.raises(DecodeError):
            read_capture(path)
    assert sys.stdout is stdout
    assert capsys.readouterr().out == ""


def test_real_hdr_pictures_are_read():
    bright = read_picture(data_path("hdr/BrightRingsNanInf.exr"))
    assert bright.notes == ("18 samples are NaN or infinite",)
    assert read_scene(data_path("hdr/StageEnvLatLong.exr")).max() == 4096
    assert read_scene(data_path("hdr/esplanade.hdr")).max() == 49664
    for name in ("CandleGlass", "Desk"):
        assert read_scene(data_path(f"hdr/{name}.exr")).min() < 0
        assert read_light(data_path(f"hdr/{name}.exr")).min() == 0


ORIENTED = np.arange(6 * 8 * 3, dtype=np.uint16).reshape(6, 8, 3) * 300


def _write_oriented(path, orientation, block=None):
    """Write ORIENTED as TIFF, PNG or JPEG that says how to turn it."""
    if path.suffix == ".tif":
        extra = [(274, 3, 1, orientation, True), (271, 2, 0, "Canon", True)]
        tifffile.imwrite(path, ORIENTED, photometric="rgb", extratags=extra)
        return
    exif = Image.Exif()
    exif[274], exif[271] = orientation, "Canon"
    pixels = (ORIENTED // 257).astype(np.uint8)
    Image.fromarray(pixels).save(
        path, exif=block or exif, **({"quality": 100} if "j" in path.suffix else {})
    )


@pytest.mark.parametrize("suffix", [".tif", ".png", ".jpg"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_samples_stay_as_stored_and_the_orientation_is_told(tmp_path, suffix, orientation):
    path = tmp_path / f"x{suffix}"
    _write_oriented(path, 1)
    stored = read_picture(path).samples
    _write_oriented(path, orientation)
    found = read_picture(path)
    assert found.orientation == orientation
    assert np.array_equal(found.samples, stored)
    assert (found.camera, found.metadata.make) == ("Canon", "Canon")


def test_a_mosaic_that_says_how_to_turn_it_keeps_its_pattern(tmp_path):
    mosaic = np.arange(48, dtype=np.uint16).reshape(6, 8)
    tifffile.imwrite(tmp_path / "x.tif", mosaic, extratags=[(274, 3, 1, 6, True)])
    options = MosaicOptions(cfa="RGGB", black_level=0, white_level=100)
    found = read_mosaic(tmp_path / "x.tif", options)
    assert (found.orientation, found.samples.tolist()) == (6, mosaic.tolist())
    assert np.array_equal(map_plain_tiff(tmp_path / "x.tif", least_bytes=1), mosaic)


def test_damaged_exif_costs_only_the_metadata(tmp_path):
    loop = b"II*\0\x08\0\0\0\x01\0" + struct.pack("<HHII", 34665, 4, 1, 8) + bytes(4)
    _write_oriented(tmp_path / "x.png", 1, b"Exif\0\0" + loop)
    found = read_picture(tmp_path / "x.png")
    assert (found.orientation, found.metadata) == (1, Metadata())


def test_the_speed_of_a_picture_is_carried_and_says_nothing_of_its_noise(tmp_path):
    extra = [(34855, 3, 1, 800, True)]
    tifffile.imwrite(tmp_path / "x.tif", ORIENTED, photometric="rgb", extratags=extra)
    found = read_picture(tmp_path / "x.tif")
    assert (found.metadata.iso, found.iso) == (800, None)
