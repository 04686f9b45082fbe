"""`camkit calibrate tone`: files, what is said, what is refused."""

import json
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.cli.exit_code import ExitCode

LEVELS = (0, 64, 128, 192, 255)
LIGHT = tuple(0.002 + 0.998 * (level / 255) ** 2.4 for level in LEVELS)


@pytest.fixture(name="steps")
def pictures_of_steps(tmp_path: Path) -> list[Path]:
    """Linear PNGs."""
    paths = [tmp_path / f"{level}.png" for level in LEVELS]
    for path, light in zip(paths, LIGHT, strict=True):
        assert cv2.imwrite(str(path), np.full((60, 90, 3), round(60_000 * light), np.uint16))
    return paths


def test_toml_page_and_json_say_the_same(camkit_command, steps: list, tmp_path: Path) -> None:
    out, page = tmp_path / "tone.toml", tmp_path / "tone.html"
    asked = ("--levels", "0,64,128,192,255", "-o", out, "--page", page)
    done = camkit_command("calibrate", "tone", *steps, *asked, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert (told.pop("out"), told.pop("page")) == (str(out), str(page))
    assert tomllib.loads(out.read_text()) == told
    assert set(told) == {"levels", "luminance", "residual_percent", "gamma", "notes"}
    assert told["luminance"] == pytest.approx(LIGHT, rel=0.01)
    assert page.read_text().count("<img") == 1
    assert camkit_command("calibrate", "tone", *steps, *asked).code == ExitCode.USAGE
    again = camkit_command("calibrate", "tone", *steps, *asked, "--overwrite")
    assert again.code == 0
    assert "gamma 2.4" in again.out
    assert "note: no picture states its exposure time" in again.err


def test_three_steps_tell_no_residual(camkit_command, steps: list, tmp_path: Path) -> None:
    out = tmp_path / "tone.toml"
    asked = ("--levels", "0,128,255", "-o", out)
    done = camkit_command("calibrate", "tone", *steps[::2], *asked, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["residual_percent"] is None
    assert "residual_percent" not in tomllib.loads(out.read_text())
    done = camkit_command("calibrate", "tone", *steps[::2], *asked, "--overwrite")
    assert done.code == 0, done.err
    assert "3 steps" in done.out
    assert "gamma" not in done.out


def test_bad_input_is_one_line_and_no_file(camkit_command, steps: list, tmp_path: Path) -> None:
    out = tmp_path / "tone.toml"
    for files, levels, code, told in (
        (steps, "0,64,128,192", ExitCode.USAGE, "states 4 levels for 5 pictures"),
        (steps, "0,128,64,192,255", ExitCode.INPUT_FAILED, "is darker than 128.png (level 64)"),
        ([*steps[:4], tmp_path / "none.png"], "0,1,2,3,4", ExitCode.INPUT_FAILED, "none.png"),
    ):
        done = camkit_command("calibrate", "tone", *files, "--levels", levels, "-o", out)
        assert done.code == code, done.err
        assert told in done.err
        assert len(done.err.strip().splitlines()) == 1
        assert not out.exists()
