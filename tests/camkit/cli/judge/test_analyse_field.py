"""`camkit analyse field`: the keys of its JSON, its page, and what it refuses in one line."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.cli.exit_code import ExitCode
from camkit.scenes import procedural_scene
from tests.bundle_factory import tiny_sensor
from tests.haze_bundle import write_hazy_bundle

KEYS = {
    "height_mm",
    "field_angle_deg",
    "peak_share_10px",
    "peak_fwhm_px",
    "share_900px",
    "shift_correlation",
    "contrast",
    "detection",
    "detection_ci",
    "cdp",
    "mtf",
    "psnr_db",
}


def test_a_bundle_is_measured_and_shown(tmp_path: Path, camkit_command) -> None:
    bundle = write_hazy_bundle(tmp_path, sensor=tiny_sensor(192, 160))
    page, data = tmp_path / "page.html", tmp_path / "data"
    data.mkdir()
    levels = np.rint(255 * procedural_scene(3, 96, 96)).astype(np.uint8)
    cv2.imwrite(str(data / "a.png"), levels.transpose(1, 2, 0)[..., ::-1])
    arguments = ("--fields", "3", "--data", data, "--page", page, "--json")
    outcome = camkit_command("analyse", "field", bundle.path, *arguments)
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    fields = told["lenses"][str(bundle.path)]["fields"]
    assert len(fields) == 3
    assert all(set(field) >= KEYS for field in fields)
    assert fields[0]["shift_correlation"] == 1
    assert fields[0]["psnr_db"]["after"] > fields[0]["psnr_db"]["before"]
    assert told["lenses"][str(bundle.path)]["method"] == "filter"
    assert set(fields[0]["mtf"]) == {"radial", "tangential"}
    assert page.read_text(encoding="utf-8").count("<img") == 5
    again = camkit_command("analyse", "field", bundle.path, "--page", page)
    assert again.code == ExitCode.USAGE
    assert "--overwrite" in again.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing-like-it"], "nothing is called 'nothing-like-it'"),
        (["duet", "--lens", "duet"], "named once"),
        (["duet", "--frame", "12"], "WIDTHxHEIGHT"),
        (["duet", "--frame", "64x64"], "128 px"),
        (["duet", "--frame", "256x256"], "give --data too"),
        (["duet", "--pictures", "2"], "give --data too"),
        (["duet", "--wavelength-um", "5"], "known from 0.42 to 0.68 um"),
        (["pinhole-0"], "> 0 mm"),
        (["pinhole-1.2.3"], "pinhole-DIAMETER"),
        (["no.safetensors"], "no.safetensors"),
        (["duet", "--iso", "0"], "iso must be > 0"),
        (["duet", "--data", "/nowhere"], "/nowhere"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], words: str, camkit_command) -> None:
    outcome = camkit_command("analyse", "field", *arguments)
    assert outcome.code != 0
    assert words in outcome.err
    assert outcome.err.count("\n") == 1
