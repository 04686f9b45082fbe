import logging
import struct
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from camkit.cfa import CFA_PATTERNS
from camkit.errors import ContractError, DecodeError
from camkit.runtime import raw, raw_worker
from camkit.runtime.capture import Capture
from camkit.runtime.files.capture_header import header_of
from camkit.runtime.files.tiff_tags import EXIF_POINTER, read_tiff_tags
from camkit.runtime.metadata import MAX_TEXT, Metadata
from camkit.runtime.raw import MosaicOptions, file_sha256, is_picture, named_bundle, read_capture
from tests.data_folder import data_path
from tests.dng_factory import (
    MATRIX,
    NOISE,
    scene_mosaic,
    write_monochrome,
    write_other,
    write_scene,
)

CFA_PHOTOMETRIC, LINEAR_RAW = 32803, 34892

# visible height and width, CFA, black, white, white balance, as the table of the data set says
REAL_FILES = {
    "sony_a7rm3_crop_DSC2164.ARW": (3464, 5184, "RGGB", 512, 16383, (2.469, 1, 1.527), 3200),
    "blackmagic_pocket4k.dng": (2176, 4128, "RGGB", 512, 65535, (2.206, 1, 1.887), None),
    "canon_kissx4_magiclantern_colorchart.dng": (
        *(1156, 1734, "RGGB", 2056, 15000),
        *((2.477, 1, 1.694), None),
    ),
    "canon_g2_colorchecker_CRW_0304.CRW": (1720, 2312, "RGGB", 32, 1023, (1.628, 1, 1.597), 50),
    "kodak_dc120_P003917.KDC": (976, 848, "GRBG", 0, 255, None, 160),
    "canon_eos6d_linear_lossy.dng": (816, 1224, None, 0, 65535, (0.997, 1, 1.001), 1000),
    "derived_24mp_rggb12.dng": (4000, 6000, "RGGB", 256, 4095, (2.738, 1, 1.369), None),
}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("raw") / "scene.dng"
    return path, write_scene(path, black=np.array([[256, 260], [264, 268]]), cfa="GRBG")


def test_isolated_and_in_process_decodes_agree(scene):
    path, mosaic = scene
    isolated, inside = read_capture(path), read_capture(path, isolate=False)
    assert np.array_equal(isolated.samples, mosaic)
    assert np.array_equal(inside.samples, mosaic)
    told = header_of(isolated)
    assert told.pop("decoder_peak_mb") > 10
    assert told == {k: v for k, v in header_of(inside).items() if k in told}


def test_everything_written_into_a_camkit_dng_comes_back(scene):
    capture = read_capture(scene[0], isolate=False)
    assert capture.cfa == "GRBG"
    assert capture.black_level.tolist() == [[256, 260], [264, 268]]
    assert capture.white_level == 4095
    assert capture.white_balance == pytest.approx((2.0, 1.0, 1.6))
    assert np.allclose(capture.color_matrix, MATRIX)
    assert capture.noise == NOISE
    assert (capture.iso, capture.exposure_time_s) == (400, 0.02)
    assert (capture.bundle_name, capture.camera) == ("duet", "camkit duet")
    assert (capture.origin_px, capture.sensor_size_px) == ((3, 4), (6000, 4000))
    assert capture.pixel_pitch_um == 5.96
    assert capture.sha256 == file_sha256(scene[0])
    assert capture.notes == ()


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_black_levels_land_on_their_positions_in_every_layout(tmp_path, cfa):
    black = np.array([[10, 20], [30, 40]])
    write_scene(tmp_path / "x.dng", cfa=cfa, black=black)
    capture = read_capture(tmp_path / "x.dng", isolate=False)
    assert (capture.cfa, capture.black_level.tolist()) == (cfa, black.tolist())


@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_is_the_exif_number_and_samples_are_not_turned(tmp_path, orientation):
    mosaic = write_scene(tmp_path / "x.dng", orientation=orientation)
    capture = read_capture(tmp_path / "x.dng", isolate=False)
    assert capture.orientation == orientation
    assert np.array_equal(capture.samples, mosaic)


@pytest.mark.parametrize(
    ("top", "left", "cfa"), [(1, 0, "GBRG"), (0, 1, "GRBG"), (1, 1, "BGGR"), (2, 2, "RGGB")]
)
def test_margins_are_cut_and_shift_the_pattern(tmp_path, top, left, cfa):
    # DNG counts the pattern from the active area, which LibRaw shrinks to even margins: every
    # layout here puts red at the even positions of the whole sensor
    mosaic = scene_mosaic(62, 82)
    extra = [
        (33421, 3, 2, (2, 2), True),
        (33422, 1, 4, bytes("RGB".index(letter) for letter in cfa), True),
        (50713, 3, 2, (2, 2), True),
        (50714, 4, 4, (10, 20, 30, 40), True),
        (50717, 4, 1, 4095, True),
        (50829, 4, 4, (top, left, 62, 82), True),
    ]
    write_other(tmp_path / "x.dng", mosaic, CFA_PHOTOMETRIC, extra)
    capture = read_capture(tmp_path / "x.dng", isolate=False)
    assert np.array_equal(capture.samples, mosaic[top + top % 2 :, left + left % 2 :])
    assert capture.cfa == "RGGB"
    if top % 2 == left % 2 == 0:
        assert capture.black_level.tolist() == [[10, 20], [30, 40]]


def test_linear_dng_is_taken_as_planes(tmp_path):
    planes = np.stack([scene_mosaic(seed=s) for s in range(3)])
    extra = [(50714, 4, 3, (64, 64, 64), True), (50717, 4, 3, (4095,) * 3, True)]
    write_other(tmp_path / "x.dng", np.moveaxis(planes, 0, -1), LINEAR_RAW, extra)
    capture = read_capture(tmp_path / "x.dng", isolate=False)
    assert capture.contract == "linear_rgb_v1"
    assert np.array_equal(capture.samples, planes)
    assert capture.black_level.tolist() == [64, 64, 64]
    assert "already demosaicked" in capture.notes[0]


def test_monochrome_sensor_becomes_three_equal_planes(tmp_path):
    plane = scene_mosaic()
    write_monochrome(tmp_path / "x.dng", plane)
    for isolate in (True, False):
        capture = read_capture(tmp_path / "x.dng", isolate=isolate)
        assert capture.cfa is None
        assert np.array_equal(capture.samples, np.stack([plane] * 3))
        assert capture.linear_rows(0, 2).shape == (3, 2, 80)
        assert "monochrome" in capture.notes[0]


def test_xtrans_mosaic_goes_through_libraws_demosaic_in_camera_space(tmp_path):
    letters = "GBGGRG RGRBGB GBGGRG GRGGBG BGBRGR GRGGBG".replace(" ", "")
    colors = np.array(["RGB".index(letter) for letter in letters]).reshape(6, 6)
    levels = np.array([1000, 2000, 1500])
    mosaic = levels[np.tile(colors, (87, 88))].astype(np.uint16)
    mosaic += np.random.default_rng(0).integers(0, 3, mosaic.shape).astype(np.uint16)
    extra = [
        (33421, 3, 2, (6, 6), True),
        (33422, 1, 36, bytes(colors.ravel().tolist()), True),
        (50714, 4, 1, 256, True),
        (50717, 4, 1, 4095, True),
    ]
    write_other(tmp_path / "x.dng", mosaic, CFA_PHOTOMETRIC, extra)
    capture = read_capture(tmp_path / "x.dng", isolate=False)
    assert "LibRaw demosaicked it" in " ".join(capture.notes)
    assert capture.samples.shape == (3, 522, 528)
    means = capture.linear_rows(0, 522)[:, 12:-12, 12:-12].mean(axis=(1, 2))
    assert means == pytest.approx((levels + 1 - 256) / (4095 - 256), abs=2e-3)


def test_float_dng_decodes_with_a_note(tmp_path):
    extra = [
        (33421, 3, 2, (2, 2), True),
        (33422, 1, 4, bytes((0, 1, 1, 2)), True),
        (50714, 4, 1, 0, True),
        (50717, 4, 1, 1, True),
    ]
    light = scene_mosaic().astype(np.float32) / 4095
    write_other(tmp_path / "x.dng", light, CFA_PHOTOMETRIC, extra)
    capture = read_capture(tmp_path / "x.dng", isolate=False)
    assert np.abs(capture.linear_rows(0, 60) - light).max() < 1e-4
    assert "floating-point DNG" in capture.notes[0]


@pytest.mark.parametrize("error", [IndexError("7"), ContractError("7"), MemoryError()])
def test_whatever_an_odd_file_raises_becomes_a_decode_error(scene, monkeypatch, error):
    def fail(*_):
        raise error

    monkeypatch.setattr(raw_worker, "to_capture", fail)
    with pytest.raises(DecodeError, match=r"makes no sense|more memory"):
        read_capture(scene[0], isolate=False)


def test_noise_profile_and_white_balance_may_be_missing(tmp_path):
    write_scene(tmp_path / "x.dng", noise=None, metadata=Metadata(), color_matrix=None)
    capture = read_capture(tmp_path / "x.dng", isolate=False)
    assert (capture.noise, capture.iso, capture.exposure_time_s) == (None, None, None)
    assert capture.color_matrix is None
    assert "no colour matrix is known for this camera" in capture.notes


@pytest.mark.parametrize("share", [0.05, 0.5, 0.99])
def test_truncated_dng_is_refused(tmp_path, share):
    path = tmp_path / "x.dng"
    write_scene(path)
    (end,) = [
        int(d[273][0] + d[279][0])
        for d in read_tiff_tags(path).directories
        if d.get(262) == (CFA_PHOTOMETRIC,)
    ]
    path.write_bytes(path.read_bytes()[: int(share * end)])
    with pytest.raises(DecodeError, match=r"x\.dng"):
        read_capture(path, isolate=False)


@settings(
    max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(flips=st.lists(st.tuples(st.integers(4, 900), st.integers(1, 255)), min_size=1, max_size=12))
def test_flipped_header_bytes_give_a_refusal_or_a_believable_capture(scene, tmp_path, flips):
    data = bytearray(scene[0].read_bytes())
    for position, mask in flips:
        data[position] ^= mask
    path = tmp_path / "flipped.dng"
    path.write_bytes(bytes(data))
    try:
        capture = read_capture(path, timeout_s=20)
    except DecodeError:
        return
    assert capture.samples.min() < capture.samples.max()
    assert capture.white_level > capture.black_level.max()


def test_time_limit_stops_the_decoder(scene):
    start = time.monotonic()
    with pytest.raises(DecodeError, match=r"longer than 0\.01 s"):
        read_capture(scene[0], timeout_s=0.01)
    assert time.monotonic() - start < 5


def test_memory_limit_is_a_refusal_not_a_crash(scene):
    with pytest.raises(DecodeError):
        read_capture(scene[0], max_memory_mb=8)


@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("import os; os.abort()", "signal 6"),
        ("import sys; sys.stderr.write('lost\\n'); sys.exit(3)", r"exit code 3 \(lost\)"),
        ("print('{}')", "makes no sense"),
        ("print('not JSON')", "makes no sense"),
        ("print('[1]')", "makes no sense"),
        ("print('x' * 3000000)", "died"),
        (
            'print(\'{"shape": [99999, 99999], "dtype": "uint16", "planes_sent": null}\')',
            "makes no sense",
        ),
        ('print(\'{"shape": [9, 9], "dtype": "uint16", "planes_sent": null}\')', "died"),
    ],
)
def test_a_child_that_misbehaves_costs_one_file(scene, monkeypatch, program, message):
    real = subprocess.Popen

    def broken_child(command, **options):
        return real([sys.executable, "-I", "-S", "-c", program], **options)

    monkeypatch.setattr(raw.subprocess, "Popen", broken_child)
    with pytest.raises(DecodeError, match=message):
        read_capture(scene[0])


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(DecodeError, match="cannot read"):
        read_capture(tmp_path / "none.dng")


@pytest.mark.parametrize("suffix", [".dng", ".cr2", ".jpg", ".png", ".tif", ".exr", ".hdr", ""])
def test_an_empty_file_is_called_empty_whatever_its_name(tmp_path, suffix):
    path = tmp_path / f"shot{suffix}"
    path.touch()
    with pytest.raises(DecodeError, match=f"^shot{suffix}: the file is empty$"):
        read_capture(path)


def test_a_pattern_for_a_raw_file_is_refused(scene):
    with pytest.raises(ContractError, match=r"omit MosaicOptions.cfa"):
        read_capture(scene[0], mosaic=MosaicOptions(cfa="RGGB", black_level=0, white_level=1))


@pytest.mark.parametrize("isolate", [True, False])
def test_levels_of_the_caller_stand_in_place_of_those_of_any_raw_file(scene, isolate):
    capture = read_capture(scene[0], isolate=isolate, mosaic=MosaicOptions(black_level=250))
    assert (capture.black_level == 250).all()
    assert capture.white_level == 4095
    capture = read_capture(scene[0], isolate=isolate, mosaic=MosaicOptions(white_level=3600.0))
    assert capture.black_level.tolist() == [[256, 260], [264, 268]]
    assert capture.white_level == 3600


def test_a_damaged_level_of_a_dng_does_not_matter_where_the_caller_says_it(tmp_path):
    path = tmp_path / "x.dng"
    write_scene(path, white=4095)
    data = path.read_bytes()
    tag = (50717).to_bytes(2, "little") + b"\x04\0\x01\0\0\0"
    at = data.index(tag) + len(tag)
    path.write_bytes(data[:at] + (100_000).to_bytes(4, "little") + data[at + 4 :])
    with pytest.raises(DecodeError, match="white"):
        read_capture(path, isolate=False)
    said = MosaicOptions(white_level=4095.0)
    assert read_capture(path, isolate=False, mosaic=said).white_level == 4095


def test_a_white_level_of_the_caller_that_the_data_contradict_is_refused(scene):
    with pytest.raises(DecodeError, match=r"MosaicOptions.white_level=1000"):
        read_capture(scene[0], isolate=False, mosaic=MosaicOptions(white_level=1000.0))
    with pytest.raises(DecodeError, match="must lie above black"):
        read_capture(scene[0], isolate=False, mosaic=MosaicOptions(white_level=200.0))


def test_levels_alone_are_not_for_pictures(tmp_path):
    cv2.imwrite(str(tmp_path / "x.png"), np.full((8, 8, 3), 7, np.uint16))
    with pytest.raises(ContractError, match="levels are for RAW files"):
        read_capture(tmp_path / "x.png", mosaic=MosaicOptions(white_level=1000.0))


def test_a_film_scanner_with_a_white_level_of_8_bits_opens_with_a_note(tmp_path):
    """LibRaw spreads the 8 bits of a Coolscan NEF over 16 and says white 255."""
    ramp = np.linspace(0, 230, 96 * 128).reshape(96, 128, 1) * [1.0, 0.9, 0.8]
    tifffile.imwrite(
        tmp_path / "scan.nef",
        ramp.astype(np.uint8),
        photometric="rgb",
        metadata=None,
        software="Nikon Scan 4.0.2",
        extratags=[(271, 2, 0, "Nikon", True), (272, 2, 0, "Nikon LS-50", True)],
    )
    capture = read_capture(tmp_path / "scan.nef", isolate=False)
    assert capture.white_level == 65535
    assert any("stated white 255" in note for note in capture.notes)
    assert capture.linear_rows(0, 96).max() == pytest.approx(230 / 255, abs=0.05)
    said = MosaicOptions(white_level=60000.0)
    told = read_capture(tmp_path / "scan.nef", isolate=False, mosaic=said)
    assert told.white_level == 60000


@pytest.mark.parametrize("limits", [{"timeout_s": 0}, {"max_memory_mb": 0}])
def test_limits_must_be_positive(scene, limits):
    with pytest.raises(ContractError, match="limits"):
        read_capture(scene[0], **limits)


def test_the_folder_of_the_caller_provides_no_modules(scene, tmp_path, monkeypatch):
    (tmp_path / "numpy.py").write_text("raise SystemExit(5)")
    monkeypatch.chdir(tmp_path)
    assert isinstance(read_capture(scene[0]), Capture)


def test_reading_works_in_a_script_without_main_guard(scene, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "from camkit.runtime.raw import read_capture\n"
        f"print(read_capture({str(scene[0])!r}).samples.shape)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout == "(60, 80)\n"
    assert done.stderr == ""


def test_the_bundle_is_named_without_a_decode(scene, tmp_path):
    assert named_bundle(scene[0]) == "duet"
    assert named_bundle(tmp_path / "none.dng") is None


def test_content_decides_between_raw_and_picture(scene, tmp_path):
    renamed = tmp_path / "scene.tif"
    renamed.write_bytes(scene[0].read_bytes())
    assert not is_picture(renamed)
    assert not is_picture(scene[0])
    (tmp_path / "x.dng").write_bytes(b"\x89PNG\r\n\x1a\n")
    assert is_picture(tmp_path / "x.dng")


def test_nothing_is_logged_by_default(scene, caplog):
    with caplog.at_level(logging.INFO):
        read_capture(scene[0], isolate=False)
    assert not caplog.records


@pytest.mark.parametrize("name", REAL_FILES)
def test_real_files_decode_to_what_their_table_says(name):
    height, width, cfa, black, white, balance, iso = REAL_FILES[name]
    isolate = name.endswith((".ARW", "24mp_rggb12.dng"))
    capture = read_capture(data_path("raw") / name, isolate=isolate)
    assert (capture.height, capture.width, capture.cfa) == (height, width, cfa)
    assert (capture.black_level == black).all()
    assert capture.white_level == white
    if balance is None:
        assert capture.white_balance is None
        assert "the file has no valid white balance" in capture.notes
    else:
        assert capture.white_balance == pytest.approx(balance, abs=1e-3)
    assert capture.iso == iso
    assert not [note for note in capture.notes if "damage" in note]
    assert (capture.color_matrix is None) == name.endswith("KDC")


def test_the_headerless_nokia_mosaic_decodes_with_its_options():
    path = data_path("raw/nokia_n900_bayer_grbg10.png")
    options = MosaicOptions(cfa="GRBG", black_level=25, white_level=1023)
    capture = read_capture(path, mosaic=options)
    assert (capture.samples.shape, capture.samples.max()) == ((1968, 2592), 959)
    assert (capture.cfa, capture.white_level) == ("GRBG", 1023)
    with pytest.raises(DecodeError, match=r"MosaicOptions.cfa"):
        read_capture(path)


def test_every_corrupt_file_is_refused_within_seconds():
    for path in sorted(data_path("raw/corrupt").iterdir()):
        start = time.monotonic()
        if path.name == "flipdata_kodak_dc120.KDC":
            notes = " ".join(read_capture(path, isolate=False).notes)
            assert "186 pixels" in notes
            continue
        with pytest.raises(DecodeError):
            read_capture(path, max_memory_mb=2048, timeout_s=20)
        assert time.monotonic() - start < 10, path.name


def test_the_decoder_starts_without_what_it_does_not_need() -> None:
    """A process is started for every file: what it imports is paid for every file."""
    code = "import sys, camkit.runtime.raw_worker\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    needless = {"pydantic", "onnxruntime", "scipy", "cv2", "typer", "PIL", "tifffile", "fractions"}
    needless |= {"concurrent.futures", "logging"}
    assert not set(done.stdout.split()) & needless


@pytest.mark.skipif(
    sys.platform != "linux", reason="only Linux tells a process of its parent's end"
)
def test_the_decoder_ends_with_its_parent() -> None:
    child = (
        "import os, sys, time\nfrom camkit.runtime.raw_worker import end_with\n"
        "end_with(int(sys.argv[1]))\nprint(os.getpid(), flush=True)\ntime.sleep(60)\n"
    )
    parent = (
        "import os, subprocess, sys\n"
        f"subprocess.run([sys.executable, '-c', {child!r}, str(os.getpid())])\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", parent], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        pid = int(process.stdout.readline())
        process.kill()
    ended = time.monotonic() + 10
    while (Path("/proc") / str(pid)).exists() and not _is_zombie(pid):
        assert time.monotonic() < ended
        time.sleep(0.01)


def _is_zombie(pid: int) -> bool:
    try:
        return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


def test_hostile_metadata_neither_fail_nor_slow_a_photograph(tmp_path):
    """Loops, offsets nowhere, counts beyond the file, text that is no text."""
    extra = [
        (33421, 3, 2, (2, 2), True),
        (33422, 1, 4, bytes((0, 1, 1, 2)), True),
        (50714, 4, 1, 256, True),
        (50717, 4, 1, 4095, True),
        (315, 2, 0, b"\x1b[31m" + bytes(range(1, 32)) + b"x" * 9000, True),
        (42036, 2, 0, b"\xff\xfe\x80 lens", True),
        (37386, 5, 1, (7, 0), True),
        (36867, 2, 0, b"9999:99:99 99:99:99", True),
    ]
    path = tmp_path / "x.dng"
    mosaic = scene_mosaic()
    write_other(path, mosaic, CFA_PHOTOMETRIC, extra)
    start = time.monotonic()
    found = read_capture(path)
    assert time.monotonic() - start < 10
    assert np.array_equal(found.samples, mosaic)
    assert found.metadata.artist.startswith("[31m xxx")
    assert len(found.metadata.artist) <= MAX_TEXT
    assert found.metadata.lens_model.isprintable()
    assert (found.metadata.focal_length_mm, found.metadata.captured_at) == (None, "")


def test_an_exif_pointer_that_leads_in_a_circle_costs_only_the_metadata(tmp_path):
    path = tmp_path / "x.dng"
    mosaic = write_scene(path)
    data = path.read_bytes()
    at = data.index(struct.pack("<HHI", EXIF_POINTER, 4, 1)) + 8
    path.write_bytes(data[:at] + struct.pack("<I", 8) + data[at + 4 :])
    found = read_capture(path)
    assert np.array_equal(found.samples, mosaic)
    assert found.metadata == Metadata(make="camkit", model="duet")
