"""`camkit calibrate noise`: files, what is said, what is refused."""

import json
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.cli.exit_code import ExitCode
from tests.camkit.calibration.sensor_factory import Sensor

KEYS = {
    *("iso", "gain_e_per_dn", "gain_error_percent", "read_noise_e", "read_noise_resolved"),
    *("full_well_e", "black_level", "white_level", "prnu_percent", "dsnu_e", "linearity_percent"),
    *("pairs", "defects_percent"),
}
GAIN_TOLERANCE = 0.03  # frames of 128x128
LEVELS = (0.1, 0.3, 0.6)


@pytest.fixture(name="frames")
def frames_of_a_sensor(tmp_path: Path) -> list:
    """Options of darks and flats."""
    sensor = Sensor(np.random.default_rng(2), gain_e_per_dn=4.0, side=128)
    dark, flat = sensor.write(tmp_path, 100, LEVELS)
    return [w for option, files in (("--dark", dark), ("--flat", flat)) for f in files for w in (option, f)]  # noqa: E501 # fmt: skip


def test_toml_page_and_json_say_the_same(camkit_command, frames: list, tmp_path: Path) -> None:
    out, page = tmp_path / "noise.toml", tmp_path / "noise.html"
    done = camkit_command("calibrate", "noise", *frames, "-o", out, "--page", page, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    (facts,) = told["iso"]
    assert set(facts) == KEYS
    assert facts["gain_e_per_dn"] == pytest.approx(4.0, rel=GAIN_TOLERANCE)
    assert not facts["read_noise_resolved"]
    assert (told.pop("out"), told.pop("page")) == (str(out), str(page))
    assert tomllib.loads(out.read_text()) == told
    text = page.read_text()
    assert text.count("<img") == 1
    assert "below 1." in text


def test_a_bound_is_said_as_one_to_people(camkit_command, frames: list, tmp_path: Path) -> None:
    asked = ("-o", tmp_path / "noise.toml")
    done = camkit_command("calibrate", "noise", *frames, *asked)
    assert done.code == 0, done.err
    assert "read noise below 1." in done.out
    assert "note: ISO 100: the read noise is finer than the converter's step" in done.err
    assert camkit_command("calibrate", "noise", *frames, *asked).code == ExitCode.USAGE
    assert camkit_command("calibrate", "noise", *frames, *asked, "--overwrite").code == 0


def test_bad_input_is_one_line_and_no_file(camkit_command, frames: list, tmp_path: Path) -> None:
    jpegs = [tmp_path / "a.jpg", tmp_path / "b.jpg"]
    for n, path in enumerate(jpegs):
        assert cv2.imwrite(str(path), np.full((80, 80, 3), 9 + n, np.uint8))
    out = tmp_path / "noise.toml"
    for asked, code, told in (
        ([*frames, "--flat", jpegs[0], "--flat", jpegs[1]], ExitCode.INPUT_FAILED, "is a picture"),
        ([*frames, "--flat", jpegs[0]], ExitCode.INPUT_FAILED, "--flat takes pairs"),
        ([*frames, "--dark", tmp_path / "x", "--dark", "y"], ExitCode.INPUT_FAILED, "cannot read"),
        ([*frames, "--iso", -1], ExitCode.USAGE, "--iso must be > 0"),
    ):
        done = camkit_command("calibrate", "noise", *asked, "-o", out)
        assert done.code == code, done.err
        assert told in done.err
        assert len(done.err.strip().splitlines()) == 1
        assert not out.exists()
