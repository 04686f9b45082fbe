"""`camkit simulate`: scenes become real DNG files that `process` takes."""

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.bundle.reader import open_bundle
from camkit.cli.exit_code import ExitCode
from camkit.errors import ContractError
from camkit.runtime.face.simulation import _check_truth, _metres
from camkit.runtime.files.picture import read_scene
from camkit.runtime.kinds.hdr.night import night_scene
from camkit.runtime.raw import read_capture
from tests.deep_bundle import write_deep_bundle
from tests.hdr_bundle import STREAK_SHARE, write_hdr_bundle


def _simulate(camkit_command, *arguments: object, out: str = "s.dng"):
    return camkit_command("simulate", *arguments, "--bundle", "tiny.camkit", "-o", out)


def test_a_procedural_scene_fills_the_sensor_and_is_then_processed(
    captures, camkit_command
) -> None:
    outcome = _simulate(camkit_command, "procedural:3", "--iso", 400)
    assert (outcome.code, outcome.out) == (0, "s.dng: 96x64, ISO 400\n")
    result = json.loads(camkit_command("process", "s.dng", "--bundle", "tiny.camkit", "--json").out)
    assert result["status"] == "ok", result["error"]


def test_the_seed_decides_the_noise_and_nothing_else(captures, camkit_command) -> None:
    for name, seed in (("one", 1), ("again", 1), ("two", 2)):
        _simulate(camkit_command, "procedural:3", "--seed", seed, out=f"{name}.dng")
    one, again, two = (read_capture(f"{n}.dng").samples for n in ("one", "again", "two"))
    np.testing.assert_array_equal(one, again)
    assert 0 < np.abs(one.astype(float) - two).mean() < 20


def test_a_picture_is_a_crop_at_its_origin(captures, camkit_command) -> None:
    scene = np.random.default_rng(0).integers(0, 255, (32, 40, 3), dtype=np.uint8)
    cv2.imwrite("scene.png", scene)
    assert _simulate(camkit_command, "scene.png", "--origin-px", "20,8").code == 0
    capture = read_capture("s.dng")
    assert (capture.width, capture.height) == (40, 32)
    assert (capture.origin_px, capture.sensor_size_px) == ((20, 8), (96, 64))
    _simulate(camkit_command, "scene.png", out="centred.dng")
    assert read_capture("centred.dng").origin_px == (28, 16)


def test_a_procedural_scene_may_be_smaller_than_the_sensor(captures, camkit_command) -> None:
    assert _simulate(camkit_command, "procedural:3", "--size-px", "48,32").code == 0
    assert read_capture("s.dng").width == 48


def test_an_existing_dng_is_kept_unless_overwrite_is_said(captures, camkit_command) -> None:
    before = (captures / "a.dng").read_bytes()
    outcome = _simulate(camkit_command, "procedural:9", out="a.dng")
    assert outcome.code == ExitCode.USAGE
    assert "--overwrite" in outcome.err
    assert (captures / "a.dng").read_bytes() == before
    assert _simulate(camkit_command, "procedural:9", "--overwrite", out="a.dng").code == 0
    assert (captures / "a.dng").read_bytes() != before


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["procedural:x"], ExitCode.USAGE),
        (["night:x"], ExitCode.USAGE),
        (["night:1", "--saturate", "0.02", "--exposure", "2"], ExitCode.USAGE),
        (["night:1", "--saturate", "1.5"], ExitCode.USAGE),
        (["flat.png", "--saturate", "0.02"], ExitCode.USAGE),
        (["black.png", "--saturate", "0.02"], ExitCode.USAGE),
        (["night:1", "--exposure", "0"], ExitCode.USAGE),
        (["night:1", "--bits", "7"], ExitCode.USAGE),
        (["night:1", "--no-plate"], ExitCode.USAGE),
        (["flat.png", "--surround-px", "12"], ExitCode.USAGE),
        (["night:1", "--truth", "truth.tif"], ExitCode.USAGE),
        (["night:1", "--truth", "a.exr"], ExitCode.USAGE),
        (["absent.png"], ExitCode.INPUT_FAILED),
        (["procedural:3", "--origin-px", "4"], ExitCode.USAGE),
        (["procedural:3", "--size-px", "200,200"], ExitCode.USAGE),
        (["procedural:3", "--size-px", "0,10"], ExitCode.USAGE),
        (["procedural:3", "--iso", "-1"], ExitCode.USAGE),
    ],
)
def test_what_cannot_be_photographed_is_refused_and_nothing_is_written(
    captures, camkit_command, arguments: list[str], code: int
) -> None:
    for name, level in (("flat", 90), ("black", 0)):
        cv2.imwrite(f"{name}.png", np.full((24, 24, 3), level, dtype=np.uint8))
    (captures / "a.exr").write_bytes(b"older")
    before = sorted(captures.iterdir())
    outcome = _simulate(camkit_command, *arguments)
    assert outcome.code == code, outcome
    assert outcome.err.count("\n") == 1
    assert sorted(captures.iterdir()) == before
    assert (captures / "a.exr").read_bytes() == b"older"


def test_a_negative_seed_is_a_usage_error(captures, camkit_command) -> None:
    assert _simulate(camkit_command, "procedural:3", "--seed", "-1").code == ExitCode.USAGE


def test_only_a_dng_is_written(captures, camkit_command) -> None:
    assert _simulate(camkit_command, "procedural:3", out="s.png").code == ExitCode.USAGE


def test_without_its_plate_a_camera_writes_no_streaks(
    tmp_path, monkeypatch, camkit_command
) -> None:
    monkeypatch.chdir(tmp_path)
    write_hdr_bundle(tmp_path)
    lamp = np.zeros((96, 96, 3), np.float32)
    lamp[46:50, 46:50] = 200
    cv2.imwrite("lamp.hdr", lamp)
    found = {}
    for name, plate in (("with", ()), ("without", ("--no-plate",))):
        call = ("simulate", "lamp.hdr", "--bundle", "streaks.camkit", *plate)
        outcome = camkit_command(*call, "-o", f"{name}.dng")
        assert outcome.code == 0, outcome.err
        samples = read_capture(f"{name}.dng").samples.astype(float) - 256
        # everything more than a dozen pixels from the lamp
        samples[34:62, 34:62] = 0
        found[name] = samples.sum() / (4095 - 256)
    # 16 pixels throw so much into their arms; a fifth fell into the square, gains took some more
    thrown = STREAK_SHARE * 200 * 16
    assert 0.4 * thrown < found["with"] < thrown
    assert found["without"] < 0.02 * found["with"]


def test_a_capture_without_the_plate_is_not_taken_for_one_with_it(
    tmp_path, monkeypatch, camkit_command
) -> None:
    monkeypatch.chdir(tmp_path)
    write_hdr_bundle(tmp_path)
    call = ("simulate", "night:1", "--bundle", "streaks.camkit", "--size-px", "64,64")
    assert camkit_command(*call, "--no-plate", "-o", "bare.dng").code == 0
    process = ("process", "bare.dng", "--out-dir", "out")
    outcome = camkit_command(*process, "--bundle", "streaks.camkit")
    assert outcome.code == ExitCode.INPUT_FAILED, outcome.err
    assert "the capture names bundle streaks without its plate, not streaks" in outcome.err
    assert camkit_command(*process, "--bundle", "none").code == 0


def test_a_depth_is_photographed_and_named_and_the_focus_without_one(
    tmp_path, monkeypatch, camkit_command
) -> None:
    monkeypatch.chdir(tmp_path)
    write_deep_bundle(tmp_path)
    call = ("simulate", "procedural:3", "--size-px", "64,48", "--bundle", "deep.camkit")
    found = {}
    for name, depth in (("focus", ()), ("same", ("--depth-m", 1)), ("near", ("--depth-m", 0.7))):
        outcome = camkit_command(*call, *depth, "-o", f"{name}.dng")
        assert outcome.code == 0, outcome.err
        found[name] = outcome.out, read_capture(f"{name}.dng").samples
    assert found["focus"][0].endswith("ISO 100, 1 m away\n")
    assert found["near"][0].endswith("0.7 m away\n")
    np.testing.assert_array_equal(found["focus"][1], found["same"][1])
    assert (found["focus"][1] != found["near"][1]).mean() > 0.1


def test_a_depth_beyond_the_bundles_is_refused_and_nothing_is_written(
    captures, camkit_command
) -> None:
    outcome = _simulate(camkit_command, "procedural:3", "--depth-m", 5)
    assert outcome.code == ExitCode.USAGE
    assert "the one depth infinity; got 5 m" in outcome.err
    assert not (captures / "s.dng").exists()


def test_a_share_of_the_scene_saturates_and_what_came_of_it_is_told(
    captures, camkit_command
) -> None:
    outcome = _simulate(camkit_command, "night:3", "--saturate", 0.03, "--json")
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    assert (told["path"], told["truth"], told["size"], told["iso"]) == (
        "s.dng",
        None,
        [96, 64],
        100,
    )
    assert told["saturated_fraction"] == round(0.03 * 96 * 64) / (96 * 64)
    assert 1 < told["peak"] <= 256
    taken = read_capture("s.dng")
    assert (taken.samples >= taken.white_level).any()
    # the same exposure by hand gives the same capture, where nothing reaches the ceiling
    assert told["peak"] < 256
    by_hand = _simulate(camkit_command, "night:3", "--exposure", told["exposure"], out="h.dng")
    assert by_hand.code == 0
    difference = taken.samples.astype(int) - read_capture("h.dng").samples
    assert np.abs(difference).max() <= 2


def test_people_are_told_the_exposure_that_was_found(captures, camkit_command) -> None:
    outcome = _simulate(camkit_command, "night:3", "--saturate", 0.03)
    assert outcome.code == 0
    assert "% saturated, peak" in outcome.out


def test_json_tells_what_an_exposure_saturates(captures, camkit_command) -> None:
    told = [
        json.loads(
            _simulate(
                camkit_command, "night:3", "--exposure", factor, "--json", out=f"{factor}.dng"
            ).out
        )
        for factor in (0.5, 4)
    ]
    assert told[0]["saturated_fraction"] < told[1]["saturated_fraction"]
    assert told[1]["peak"] == pytest.approx(8 * told[0]["peak"])


def test_the_truth_lies_beside_the_capture_at_its_exposure(captures, camkit_command) -> None:
    outcome = _simulate(
        *(camkit_command, "night:3", "--saturate", 0.03, "--truth", "t/truth.exr", "--json")
    )
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    assert told["truth"] == "t/truth.exr"
    truth = read_scene(captures / "t" / "truth.exr")
    scene = np.minimum(night_scene(3, 64, 96) * told["exposure"], 256)
    assert truth.shape == scene.shape
    np.testing.assert_allclose(truth.mean(), scene.mean(), rtol=0.05)
    again = _simulate(camkit_command, "night:3", "--truth", "t/truth.exr", out="new.dng")
    assert again.code == ExitCode.USAGE
    assert not (captures / "new.dng").exists()


def test_a_surround_is_drawn_and_not_photographed(captures, camkit_command) -> None:
    for name, ring in (("ring", 20), ("none", 0)):
        arguments = ("night:5", "--size-px", "60,40", "--surround-px", ring)
        assert _simulate(camkit_command, *arguments, out=f"{name}.dng").code == 0
        taken = read_capture(f"{name}.dng")
        assert (taken.width, taken.height) == (60, 40)


def test_other_bits_are_photographed(captures, camkit_command) -> None:
    assert _simulate(camkit_command, "night:5", "--bits", 10).code == 0
    assert read_capture("s.dng").white_level == 1023


def test_a_distance_is_told_in_json_which_has_no_infinity(
    tmp_path, monkeypatch, camkit_command
) -> None:
    monkeypatch.chdir(tmp_path)
    write_deep_bundle(tmp_path)
    call = ("simulate", "procedural:3", "--size-px", "64,48", "--bundle", "deep.camkit", "--json")
    told = json.loads(camkit_command(*call, "--depth-m", 0.7, "-o", "near.dng").out)
    assert told["object_distance_m"] == pytest.approx(0.7)
    assert _metres(math.inf) == "inf"
    assert _metres(None) is None


def test_capture_and_truth_cannot_be_one_file(captures) -> None:
    with pytest.raises(ContractError, match="different names"):
        _check_truth(Path("a.exr"), captures / "a.exr", open_bundle(captures / "tiny.camkit"))


@pytest.mark.parametrize(("ring", "size"), [(0, (32, 24)), (4, (32, 24)), (0, (96, 64))])
def test_the_middle_of_a_picture_is_photographed_in_the_size_that_is_asked(
    camkit_command, captures: Path, ring: int, size: tuple[int, int]
) -> None:
    rng = np.random.default_rng(5)
    picture = rng.integers(20, 200, (64, 96, 3), dtype=np.uint8)
    width, height = (side + 2 * ring for side in size)
    top, left = (64 - height) // 2, (96 - width) // 2
    cv2.imwrite("whole.png", picture)
    cv2.imwrite("part.png", picture[top : top + height, left : left + width])
    made = []
    for scene, more in (("whole.png", ("--size-px", f"{size[0]},{size[1]}")), ("part.png", ())):
        call = ("simulate", scene, "--bundle", "tiny.camkit", "-o", f"{scene}.dng", *more)
        done = camkit_command(*call, "--surround-px", ring, "--json")
        assert done.code == 0, done.err
        assert json.loads(done.out)["size"] == list(size)
        made.append(read_capture(Path(f"{scene}.dng")).samples)
    np.testing.assert_array_equal(*made)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--size-px", "98,64"), "p.png has 96x64 pixels; --size-px 98,64 needs 98x64"),
        (("--size-px", "96,64", "--surround-px", "2"), "with a ring of 2 px needs 100x68"),
        (("--size-px", "0,4"), "--size-px takes two numbers >= 1"),
        (("--size-px", "-4,4"), "--size-px takes two numbers >= 1"),
    ],
)
def test_a_size_that_a_picture_does_not_have_is_refused(
    camkit_command, captures: Path, words: tuple[str, ...], told: str
) -> None:
    cv2.imwrite("p.png", np.full((64, 96, 3), 90, np.uint8))
    done = camkit_command("simulate", "p.png", "--bundle", "tiny.camkit", "-o", "p.dng", *words)
    assert done.code == ExitCode.USAGE
    assert told in done.err
    assert not Path("p.dng").exists()
