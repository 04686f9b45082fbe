"""`camkit calibrate flat`: files, what is said, what is refused."""

import json
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from camkit.cli.exit_code import ExitCode
from tests.camkit.calibration.display_factory import GOOD, Flats, Shift

TOLERANCE = 0.01
LENS = Flats()
PITCH = ("--pixel-pitch-um", 5)


def _said(shifts: Sequence[Shift]) -> list:
    texts, turns = LENS.said(shifts)
    words = [w for text, turn in zip(texts, turns, strict=True) for w in ("--shift-px", text, "--turn-deg", turn)]  # noqa: E501 # fmt: skip
    return [*words, *PITCH]


def test_toml_page_and_json_say_the_same(camkit_command, tmp_path: Path) -> None:
    files = LENS.write_planes(tmp_path, GOOD)
    out, page = tmp_path / "flat.toml", tmp_path / "flat.html"
    asked = (*_said(GOOD), "-o", out, "--page", page)
    done = camkit_command("calibrate", "flat", *files, *asked, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert (told.pop("out"), told.pop("page")) == (str(out), str(page))
    assert tomllib.loads(out.read_text()) == told
    assert told["separated"] is True
    radius = np.array(told["heights_mm"]) / (LENS.radius_px * 0.005)
    wrong = np.array(told["relative_illumination"]) / LENS.lens(radius) - 1
    assert np.abs(wrong).max() < TOLERANCE
    assert page.read_text().count("<img") == 2
    again = camkit_command("calibrate", "flat", *files, *asked)
    assert again.code == ExitCode.USAGE
    assert camkit_command("calibrate", "flat", *files, *asked, "--overwrite").code == 0


def test_a_shift_to_the_left_is_no_option(camkit_command, tmp_path: Path) -> None:
    shifts: list[Shift] = [(0, 0, 0), (-0.3, 0, 0), (0, -0.3, 0), (0, 0, -90)]
    files = LENS.write_planes(tmp_path, shifts)
    done = camkit_command("calibrate", "flat", *files, *_said(shifts), "-o", tmp_path / "flat.toml")
    assert done.code == 0, done.err
    assert "told from the display" in done.out


def test_one_picture_is_written_with_a_warning(camkit_command, tmp_path: Path) -> None:
    files = LENS.write_planes(tmp_path, GOOD[:1])
    out, page = tmp_path / "flat.toml", tmp_path / "flat.html"
    done = camkit_command("calibrate", "flat", *files, *PITCH, "-o", out, "--page", page)
    assert done.code == 0, done.err
    assert "note: one picture does not tell the lens" in done.err
    assert "not told from the display" in done.out
    assert tomllib.loads(out.read_text())["separated"] is False
    assert "NOT told apart" in page.read_text()


def test_bad_input_is_one_line_and_no_file(camkit_command, tmp_path: Path) -> None:
    files = LENS.write_planes(tmp_path, GOOD[:1])
    (tmp_path / "bright").mkdir()
    bright = Flats(level=1.5).write_planes(tmp_path / "bright", GOOD[:1])
    (tmp_path / "text.dng").write_text("no picture")
    out = tmp_path / "flat.toml"
    for asked, code, told in (
        ([*bright, *PITCH], ExitCode.INPUT_FAILED, "of green is clipped"),
        ([tmp_path / "text.dng", *PITCH], ExitCode.INPUT_FAILED, "text.dng"),
        ([tmp_path / "none.png", *PITCH], ExitCode.INPUT_FAILED, "none.png"),
        ([*files], ExitCode.USAGE, "add --pixel-pitch-um"),
        ([*files, *PITCH, "--shift-px", "1"], ExitCode.USAGE, "takes two numbers X,Y"),
        ([*files, *PITCH, "--turn-deg", 1, "--turn-deg", 2], ExitCode.USAGE, "given 2 times for 1"),
    ):
        done = camkit_command("calibrate", "flat", *asked, "-o", out)
        assert done.code == code, done.err
        assert told in done.err
        assert len(done.err.strip().splitlines()) == 1
        assert not out.exists()
