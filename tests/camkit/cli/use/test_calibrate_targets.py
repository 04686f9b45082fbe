"""`camkit calibrate targets`: files, their list, what is refused."""

import json
import tomllib

import cv2
import numpy as np
import pytest
from PIL import Image

from camkit.calibration.display.marks import find_marks
from camkit.calibration.display.targets import Targets
from camkit.cli.exit_code import ExitCode
from camkit.cli.use.calibrate.folder import Folder


@pytest.fixture(name="picture")
def small_picture(tmp_path):
    path = tmp_path / "sea side.png"
    ramp = np.linspace(0, 255, 90).astype(np.uint8)
    Image.fromarray(np.stack([np.tile(ramp, (60, 1))] * 3, axis=-1)).save(path)
    return path


def test_the_list_says_what_every_png_is(camkit_command, picture, tmp_path):
    out = tmp_path / "targets"
    asked = (picture, "-o", out, "--screen", "640x400", "--board", "7x5", "--levels", "0,255")
    done = camkit_command("calibrate", "targets", *asked, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told.pop("out") == str(out)
    assert tomllib.loads((out / "targets.toml").read_text()) == told
    files = [one["file"] for one in told["targets"]]
    assert sorted(files) == files
    assert sorted(path.name for path in out.iterdir()) == [*files, "targets.toml"]
    kinds = [one["kind"] for one in told["targets"]]
    assert kinds == ["board", *["grey"] * 2, *["colour"] * 7, "picture"]
    for one in told["targets"]:
        shown = cv2.imread(str(out / one["file"]), cv2.IMREAD_UNCHANGED)
        assert (shown.shape, shown.dtype) == ((400, 640, 3), np.uint8)
        marks = find_marks(shown.mean(axis=2).astype(np.float32))
        assert (None if marks is None else marks.number) == one.get("code")
    assert told["targets"][-1]["name"] == "sea_side"
    assert Targets.read(out).to_record() == told
    assert camkit_command("calibrate", "targets", *asked).code == ExitCode.USAGE
    again = camkit_command("calibrate", "targets", *asked, "--overwrite")
    assert "a board of 7x5 corners, 2 grey steps, 7 colours, 1 pictures" in again.out


def test_a_page_shows_what_was_written(camkit_command, picture, tmp_path):
    page = tmp_path / "pages" / "targets.html"
    asked = (picture, "-o", tmp_path / "t", "--screen", "640x400", "--levels", "0", "--page", page)
    done = camkit_command("calibrate", "targets", *asked, "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["page"] == str(page)
    assert "sea side.png, sRGB" in page.read_text(encoding="utf-8")
    assert camkit_command("calibrate", "targets", *asked, "--overwrite").code == 0
    again = camkit_command(
        "calibrate", "targets", "-o", tmp_path / "u", "--screen", "640x400", "--page", page
    )
    assert (again.code, (tmp_path / "u").exists()) == (ExitCode.USAGE, False)


def test_the_board_shown_is_found_as_a_board_of_its_corners(camkit_command, tmp_path):
    asked = ("-o", tmp_path / "t", "--screen", "640x400", "--levels", "0")
    assert camkit_command("calibrate", "targets", *asked).code == 0
    shown = cv2.imread(str(tmp_path / "t" / "001-board.png"), cv2.IMREAD_GRAYSCALE)
    found, _ = cv2.findChessboardCornersSB(shown, (9, 6))
    assert found


@pytest.mark.parametrize(
    ("change", "code", "told"),
    [
        (("--screen", "640"), ExitCode.USAGE, "a screen is WIDTHxHEIGHT"),
        (("--screen", "64x40"), ExitCode.USAGE, "a screen has 320 to 16384 px"),
        (("--board", "2x2"), ExitCode.USAGE, "inner corners along either side"),
        (("--levels", "0,300"), ExitCode.USAGE, "levels are different numbers"),
        (("--levels", "0,x"), ExitCode.USAGE, "takes whole numbers"),
        (("twice",), ExitCode.USAGE, "would both be called sea_side"),
        (("none.png",), ExitCode.INPUT_FAILED, "none.png"),
        (("junk.png",), ExitCode.INPUT_FAILED, "junk.png"),
    ],
)
def test_bad_input_is_one_line_and_no_file(camkit_command, picture, tmp_path, change, code, told):
    (tmp_path / "junk.png").write_bytes(b"\x89PNG\r\n\x1a\nno picture")
    out = tmp_path / "targets"
    more = {"twice": (picture,)}.get(change[0], change)
    if change[0].endswith(".png"):
        more = (tmp_path / change[0],)
    done = camkit_command("calibrate", "targets", picture, "-o", out, "--screen", "640x400", *more)
    assert done.code == code, done.err
    assert told in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not out.exists()


@pytest.mark.parametrize("name", ["board", "grey-16", "red-half"])
def test_a_picture_by_the_name_of_another_target_is_refused(
    camkit_command, picture, tmp_path, name
):
    path, out = picture.rename(tmp_path / f"{name}.png"), tmp_path / "targets"
    asked = ("calibrate", "targets", path, "-o", out, "--screen", "640x400")
    done = camkit_command(*asked, "--levels", "16,255")
    assert done.code == ExitCode.USAGE
    assert f"a target of its own would both be called {name}" in done.err
    if name == "grey-16":
        assert camkit_command(*asked, "--levels", "0,255").code == 0


def test_a_folder_of_other_things_is_left_alone(camkit_command, picture, tmp_path):
    out = tmp_path / "home"
    out.mkdir()
    (out / "letter.txt").write_text("dear")
    asked = ("calibrate", "targets", picture, "-o", out, "--screen", "640x400")
    assert "add --overwrite" in camkit_command(*asked).err
    assert "holds files of another kind" in camkit_command(*asked, "--overwrite").err
    assert [path.name for path in out.iterdir()] == ["letter.txt"]


def test_a_file_beside_the_folder_appears_with_it_or_not_at_all(tmp_path):
    beside = tmp_path / "pages" / "page.html"
    folder = Folder.checked(tmp_path / "made", ("list",), (".",), overwrite=False)
    names = ["list", str(beside)]

    def fill(error: Exception | None) -> None:
        with folder.writing(names) as parts:
            for part in parts:
                part.write_text("all")
            if error is not None:
                raise error

    with pytest.raises(OSError, match="full"):
        fill(OSError("full"))
    assert list(tmp_path.iterdir()) == []
    fill(None)
    assert (beside.read_text(), (tmp_path / "made" / "list").read_text()) == ("all", "all")
