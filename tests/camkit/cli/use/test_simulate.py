"""`camkit simulate`: scenes become real DNG files that `process` takes."""

import json

import cv2
import numpy as np
import pytest

from camkit.cli.exit_code import ExitCode
from camkit.runtime.raw import read_capture
from tests.deep_bundle import write_deep_bundle


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
    outcome = _simulate(camkit_command, *arguments)
    assert outcome.code == code, outcome
    assert outcome.err.count("\n") == 1
    assert not (captures / "s.dng").exists()


def test_a_negative_seed_is_a_usage_error(captures, camkit_command) -> None:
    assert _simulate(camkit_command, "procedural:3", "--seed", "-1").code == ExitCode.USAGE


def test_only_a_dng_is_written(captures, camkit_command) -> None:
    assert _simulate(camkit_command, "procedural:3", out="s.png").code == ExitCode.USAGE


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
