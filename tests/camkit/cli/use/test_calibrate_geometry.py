"""`camkit calibrate geometry`: what is written and said, what is refused without a file."""

import json
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.calibration.geometry.camera_model import MODELS, project
from camkit.cli.exit_code import ExitCode
from tests.camkit.calibration.geometry.board_factory import (
    BOARD,
    Shot,
    camera_of,
    photograph,
    poses_around,
    write_photographs,
)

BARREL = camera_of(MODELS[2], 340, (207.5, 141.0), -0.25, 0.06)
SHOT = Shot(fine=2)
KEYS = {
    "board", "pictures", "width_px", "height_px", "model", "focal_px", "centre_px", "coefficients",
    "rms_px", "held_out_rms_px", "held_out_worst_px", "covered_radius_px", "radial", "notes",
}  # fmt: skip


@pytest.fixture(scope="module")
def pictures(tmp_path_factory) -> list[Path]:
    poses = poses_around(BARREL, SHOT.size, 6, seed=1)
    return write_photographs(tmp_path_factory.mktemp("board"), BARREL, poses, SHOT)


def test_toml_json_and_page_are_written(camkit_command, pictures, tmp_path: Path) -> None:
    out, page = tmp_path / "new" / "camera.toml", tmp_path / "camera.html"
    asked = ("--board", "7x5", "--square-mm", 12.5, "-o", out, "--page", page, "--json")
    done = camkit_command("calibrate", "geometry", *pictures, *asked)
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert (told.pop("out"), told.pop("page")) == (str(out), str(page))
    assert set(told) == KEYS
    assert tomllib.loads(out.read_text()) == told
    assert told["focal_px"] == pytest.approx(340, rel=0.01)
    assert set(told["radial"]) == {"coefficients", "radius_px", "residual_px"}
    assert set(told["pictures"][0]) == {"file", "found", "rms_px", "distance_mm"}
    assert page.read_text().startswith("<!doctype html>")


def test_the_same_is_said_for_people(camkit_command, pictures, tmp_path: Path) -> None:
    asked = ("--board", "7x5", "-o", tmp_path / "camera.toml")
    done = camkit_command("calibrate", "geometry", *pictures, *asked)
    assert done.code == 0, done.err
    assert "focal length 3" in done.out
    assert "in 6 of 6 pictures; in pictures left out of the fit" in done.out
    assert "note: corners were seen to" in done.err
    again = camkit_command("calibrate", "geometry", *pictures, *asked)
    assert again.code == ExitCode.USAGE
    assert "add --overwrite" in again.err
    assert camkit_command("calibrate", "geometry", *pictures, *asked, "--overwrite").code == 0


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--board", "7by5", "-o", "c.toml"), "like 9x6; got '7by5'"),
        (("--board", "1x5", "-o", "c.toml"), "3 to 100 inner corners"),
        (("--board", "7x5", "--square-mm", "-1", "-o", "c.toml"), "must be > 0 mm"),
        (("--board", "7x5", "-o", "c.json"), "expected a name in .toml"),
        (("--board", "7x5", "-o", "c.toml", "--page", "c.pdf"), "expected a name in .html"),
    ],
)
def test_wrong_wishes_give_one_line_and_no_file(
    camkit_command, pictures, tmp_path: Path, monkeypatch, options, told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    done = camkit_command("calibrate", "geometry", *pictures, *options)
    assert done.code == ExitCode.USAGE
    assert told in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def _odd(name: str, pictures: list[Path], folder: Path) -> list[Path]:
    path = folder / f"{name}.png"
    if name == "empty":
        path.write_bytes(b"")
    elif name == "text":
        path.write_text("no picture")
    elif name == "twice":
        return [*pictures, pictures[0]]
    elif name == "other":
        pose = poses_around(BARREL, SHOT.size, 12, seed=3)[10]
        cv2.imwrite(str(path), photograph(BARREL, pose, Shot(stretch=1.15, fine=2)))
    elif name == "large":
        cv2.imwrite(str(path), np.zeros((301, 400, 3), np.uint8))
    return [*pictures, path]


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("empty", "empty.png"),
        ("text", "text.png"),
        ("absent", "absent.png"),
        ("twice", "are the same picture"),
        ("large", "large.png has 400x301 px"),
        ("other", "does not fit other.png"),
    ],
)
def test_bad_pictures_give_one_line_and_no_file(
    camkit_command, pictures, tmp_path: Path, name: str, told: str
) -> None:
    files = _odd(name, pictures, tmp_path)
    asked = ("--board", "7x5", "-o", tmp_path / "c.toml", "--page", tmp_path / "c.html", "--json")
    done = camkit_command("calibrate", "geometry", *files, *asked)
    assert done.code == ExitCode.INPUT_FAILED
    assert told in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert done.out == ""
    assert not list(tmp_path.glob("c.*"))


def test_a_board_that_is_not_there_fails_the_input(camkit_command, pictures, tmp_path) -> None:
    asked = ("--board", "9x6", "-o", tmp_path / "c.toml")
    done = camkit_command("calibrate", "geometry", *pictures[:3], *asked)
    assert done.code == ExitCode.INPUT_FAILED
    assert "no picture shows a board of 9x6 inner corners" in done.err
    assert not (tmp_path / "c.toml").exists()


def test_a_corner_file_takes_the_place_of_photographs(camkit_command, tmp_path: Path) -> None:
    poses = poses_around(BARREL, SHOT.size, 5, seed=1)
    pictures = [project(BARREL, pose, BOARD.points)[0].tolist() for pose in poses]
    given, out = tmp_path / "corners.json", tmp_path / "camera.toml"
    document = {"board": "7x5", "width_px": 400, "height_px": 300, "pictures": pictures}
    given.write_text(json.dumps(document))
    done = camkit_command("calibrate", "geometry", given, "--focal-px", 300, "-o", out, "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["focal_px"] == pytest.approx(340, rel=0.01)
    asked = ("-o", tmp_path / "other.toml")
    wrong = camkit_command("calibrate", "geometry", given, "--board", "9x6", *asked)
    assert wrong.code == ExitCode.USAGE
    assert "holds corners of a board of 7x5, not 9x6" in wrong.err
    lacking = camkit_command("calibrate", "geometry", tmp_path / "a.png", *asked)
    assert lacking.code == ExitCode.USAGE
    assert "--board is needed" in lacking.err
