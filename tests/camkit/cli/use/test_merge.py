"""`camkit merge`: what it writes, what it says, and what it refuses without leaving a file."""

import json
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest

from camkit.cli.exit_code import ExitCode
from camkit.runtime.files.picture import read_scene
from tests.data_folder import data_path
from tests.runtime.merging.bracket_factory import scene, write_coded, write_dng

TIMES = "1,0.25,0.0625"


@pytest.fixture
def pictures(tmp_path: Path) -> list[Path]:
    """Three exposures in sRGB, longest first."""
    paths = [tmp_path / f"{name}.png" for name in ("long", "middle", "short")]
    for path, time_s in zip(paths, (1, 0.25, 0.0625), strict=True):
        write_coded(path, scene() * time_s)
    return paths


def _write_exr(path: Path, **channels: np.ndarray) -> None:
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as file:
        file.write(str(path))


def test_pictures_become_a_float_exr_whose_white_is_that_of_the_middle_frame(
    camkit_command, pictures: list[Path], tmp_path: Path
) -> None:
    out = tmp_path / "new" / "out.exr"
    done = camkit_command(
        "merge", *pictures, "-o", out, "--times", TIMES, "--response", "srgb", "--json"
    )
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["frames"] == ["long.png", "middle.png", "short.png"]
    assert told["times_s"] == [1, 0.25, 0.0625]
    assert (told["response"], told["reference"]) == ("srgb", "middle.png")
    luminance = np.tensordot((0.2126, 0.7152, 0.0722), np.minimum(scene(), 16), 1)
    assert told["range_stops"] == pytest.approx(np.log2(luminance.max() / luminance.min()), abs=0.4)
    assert 0 <= told["clipped_fraction"] < 0.2
    with OpenEXR.File(str(out)) as file:
        assert file.channels()["RGB"].pixels.dtype == np.float32
        assert file.header()["expTime"] == 0.25
    light = scene() * 0.25
    inside = (light > 0.05) & (light < 3)
    assert np.abs(np.log2(read_scene(out) / light)[inside]).max() < 0.15


def test_another_frame_may_be_the_reference_and_text_says_so(
    camkit_command, pictures: list[Path], tmp_path: Path
) -> None:
    made = []
    for name in ("long.png", "short.png"):
        out = tmp_path / f"{name}.exr"
        done = camkit_command("merge", *pictures, "-o", out, "--times", TIMES, "--reference", name)
        assert done.code == 0, done.err
        assert f"1.0 is the white of {name}" in done.out
        made.append(read_scene(out))
    np.testing.assert_allclose(made[0] / 16, made[1], rtol=1e-5)
    wrong = camkit_command(
        "merge", *pictures, "-o", tmp_path / "x.exr", "--times", TIMES, "--reference", "x.png"
    )
    assert wrong.code == ExitCode.USAGE
    assert "names 0 of them" in wrong.err


def test_raw_frames_are_developed_with_the_times_of_their_files(
    camkit_command, tmp_path: Path
) -> None:
    light = scene(48, 64).mean(axis=0)
    for name, time_s in (("a", 1.0), ("b", 0.125), ("c", 1 / 64)):
        write_dng(tmp_path / f"{name}.dng", light, time_s)
    out = tmp_path / "out.exr"
    done = camkit_command("merge", *sorted(tmp_path.glob("?.dng")), "-o", out, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["times_s"] == [1, 0.125, 0.015625]
    assert (told["response"], told["reference"]) == ("linear", "b.dng")
    found, truth = read_scene(out)[1, 4:-4, 4:-4], (light * 0.125)[4:-4, 4:-4]
    inside = (truth > 0.03) & (truth < 6)
    assert np.median(np.abs(np.log2(found / truth)[inside])) < 0.05


def test_linear_frames_in_files_of_floats_are_merged(camkit_command, tmp_path: Path) -> None:
    light = scene(48, 64)
    for name, time_s in (("a", 1.0), ("b", 0.05)):
        seen = np.minimum(light * time_s, 1).astype(np.float32)
        _write_exr(tmp_path / f"{name}.exr", **dict(zip("RGB", seen, strict=True)))
    out, files = tmp_path / "out.exr", (tmp_path / "a.exr", tmp_path / "b.exr")
    asked = ("--times", "1,0.05", "--reference", "a.exr")
    assert camkit_command("merge", *files, "-o", out, *asked).code == 0
    inside = light * 0.05 < 0.98
    np.testing.assert_allclose(read_scene(out)[inside], light[inside], rtol=1e-3)


def test_notes_of_the_choice_are_said_on_stderr(camkit_command, tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_coded(tmp_path / f"{name}.png", np.full((3, 40, 40), 2.0, dtype=np.float32))
    out, files = tmp_path / "out.exr", (tmp_path / "a.png", tmp_path / "b.png")
    done = camkit_command("merge", *files, "-o", out, "--times", "1,2")
    assert done.code == 0
    assert "note: too few pixels are unclipped" in done.err
    assert "100.0000% clipped in all" in done.out


@pytest.mark.parametrize(
    ("files", "options", "code", "told"),
    [
        (["long", "middle"], ["--times", "1"], ExitCode.USAGE, "1 times for 2 files"),
        (["long", "middle"], [], ExitCode.USAGE, "2 of 2 frames state no exposure time"),
        (["long", "middle"], ["--times", "2,2"], ExitCode.USAGE, "two different exposures"),
        (["long", "long"], ["--times", "1,2"], ExitCode.USAGE, "is given twice"),
        (["long"], ["--times", "1"], ExitCode.USAGE, "2 to 256 frames; got 1"),
        (["long", "small"], ["--times", "1,2"], ExitCode.INPUT_FAILED, "differ in size"),
        (["long", "deep"], ["--times", "1,2"], ExitCode.INPUT_FAILED, "differ in type"),
        (["long", "nan"], ["--times", "1,2"], ExitCode.INPUT_FAILED, "1 samples are NaN"),
        (["long", "depth"], ["--times", "1,2"], ExitCode.INPUT_FAILED, "expected EXR channels"),
        (["long", "cut"], ["--times", "1,2"], ExitCode.INPUT_FAILED, "damaged"),
        (["long", "none"], ["--times", "1,2"], ExitCode.INPUT_FAILED, "none.png"),
        (["long", "middle"], ["--times", "1,2", "--response", "log"], ExitCode.USAGE, "linear, s"),
        (["deep", "dark"], ["--times", "1,2", "--response", "estimate"], ExitCode.USAGE, "8-bit"),
        (["long", "middle"], ["--times", "1,2", "--mosaic", "RGGB"], ExitCode.USAGE, "needs"),
    ],
)
def test_bad_brackets_give_one_line_and_no_file(
    camkit_command, pictures, tmp_path: Path, files, options, code, told
) -> None:
    write_coded(tmp_path / "small.png", scene(40, 64))
    for name in ("deep", "dark"):
        assert cv2.imwrite(str(tmp_path / f"{name}.png"), np.full((48, 64, 3), 9, np.uint16))
    plane = np.ones((48, 64), dtype=np.float32)
    _write_exr(tmp_path / "nan.exr", R=plane, G=plane, B=np.where(plane.cumsum() == 7, np.nan, 1).astype(np.float32).reshape(48, 64))  # noqa: E501 # fmt: skip
    _write_exr(tmp_path / "depth.exr", Z=plane, ZBack=plane)
    (tmp_path / "cut.png").write_bytes((tmp_path / "long.png").read_bytes()[:300])
    found = {path.stem: path for path in tmp_path.glob("*.*")}
    named = [found.get(name, tmp_path / f"{name}.png") for name in files]
    done = camkit_command("merge", *named, "-o", tmp_path / "out.exr", *options)
    assert done.code == code
    assert told in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not list(tmp_path.glob("out*"))


def test_frames_of_other_aperture_or_iso_need_stated_exposures(
    camkit_command, tmp_path: Path
) -> None:
    for name, iso, time_s in (("a", 100.0, 1.0), ("b", 400.0, 0.5)):
        write_dng(tmp_path / f"{name}.dng", scene()[1], time_s, iso=iso)
    files, out = (tmp_path / "a.dng", tmp_path / "b.dng"), tmp_path / "out.exr"
    done = camkit_command("merge", *files, "-o", out)
    assert done.code == ExitCode.USAGE
    assert "differ in ISO (100, 400)" in done.err
    assert camkit_command("merge", *files, "-o", out, "--times", "1,2").code == 0


def test_nothing_is_written_over_without_a_word(
    camkit_command, pictures: list[Path], tmp_path: Path
) -> None:
    out = tmp_path / "out.exr"
    out.write_bytes(b"mine")
    asked = ("merge", *pictures, "-o", out, "--times", TIMES, "--response", "srgb")
    done = camkit_command(*asked)
    assert done.code == ExitCode.USAGE
    assert out.read_bytes() == b"mine"
    assert camkit_command(*asked, "--overwrite").code == 0
    assert read_scene(out).shape == (3, 48, 64)
    other = camkit_command("merge", *pictures, "-o", tmp_path / "out.png", "--times", TIMES)
    assert other.code == ExitCode.USAGE
    assert "expected a name in .exr" in other.err


def test_a_real_bracket_is_merged_by_its_list(camkit_command, tmp_path: Path) -> None:
    folder = data_path("hdr_brackets/memorial")
    files = [folder / f"memorial{n:04d}.png" for n in (64, 67, 70, 73)]
    asked = ("--times", folder / "image_list.txt", "--json")
    done = camkit_command("merge", *files, "-o", tmp_path / "out.exr", *asked)
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["times_s"] == [4, 0.5, 0.0625, 0.0078125]
    assert told["response"] == "estimate"
    assert told["range_stops"] > 12


def _folder(folder: Path, times_s: tuple[float, ...] = (1, 0.25, 0.0625)) -> Path:
    """Make a folder of frames with their list of times."""
    folder.mkdir(parents=True)
    for number, time_s in enumerate(times_s):
        write_coded(folder / f"{number}.png", scene() * time_s)
    lines = [f"{number}.png {time_s}" for number, time_s in enumerate(times_s)]
    (folder / "times.txt").write_text("\n".join(lines))
    return folder


def test_a_folder_stands_for_its_frames(camkit_command, pictures, tmp_path: Path) -> None:
    folder, named, whole = _folder(tmp_path / "night"), tmp_path / "a.exr", tmp_path / "b.exr"
    asked = ("--response", "srgb")
    done = camkit_command("merge", folder, "-o", whole, "--times", "times.txt", *asked)
    assert done.code == 0, done.err
    done = camkit_command("merge", *pictures, "-o", named, "--times", TIMES, *asked)
    assert done.code == 0, done.err
    np.testing.assert_array_equal(read_scene(named), read_scene(whole))


@pytest.mark.parametrize("named", [["in"], ["in/one", "in/two"]])
def test_each_folder_is_a_bracket_and_one_that_fails_stops_no_other(
    camkit_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    _folder(tmp_path / "in" / "one", (1, 1))
    _folder(tmp_path / "in" / "two")
    done = camkit_command("merge", *named, "-o", "out", "--times", "times.txt", "--json")
    assert done.code == ExitCode.INPUT_FAILED
    assert "in/one: a bracket needs two different exposures" in done.err
    assert json.loads(done.out)["out"] == "out/two.exr"
    assert [path.name for path in sorted((tmp_path / "out").iterdir())] == ["two.exr"]


def test_a_merged_picture_and_its_preview_are_no_frames_of_their_folder(
    camkit_command, tmp_path: Path
) -> None:
    folder = _folder(tmp_path / "night")
    out = folder / "x.exr"
    call = ("merge", folder, "-o", out, "--times", TIMES, "--preview", "--json")
    done = camkit_command(*call)
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["preview"] == str(folder / "x.preview.jpg")
    assert cv2.imread(told["preview"]).shape == (48, 64, 3)
    again = camkit_command(*call)
    assert again.code == ExitCode.USAGE
    assert "x.exr exists" in again.err
    out.unlink()
    again = camkit_command(*call)
    assert "x.preview.jpg exists" in again.err


@pytest.mark.parametrize("files", [["absent"], ["night", "absent.jpg"], ["absent/a.dng"]])
def test_what_is_not_there_is_named(
    camkit_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, files
) -> None:
    monkeypatch.chdir(tmp_path)
    _folder(tmp_path / "night")
    done = camkit_command("merge", *files, "-o", "a.exr", "--times", TIMES)
    assert done.code == ExitCode.INPUT_FAILED, done.err
    assert f"there is no file or folder {files[-1]}" in done.err


@pytest.mark.parametrize("response", [None, "linear", "srgb"])
def test_deep_codes_that_are_taken_as_light_are_said_to_be(
    camkit_command, tmp_path: Path, response
) -> None:
    names = []
    for number, time_s in enumerate((1.0, 0.25)):
        names.append(tmp_path / f"{number}.png")
        codes = np.rint(65535 * np.clip(scene(48, 64) * time_s, 0, 1)).astype(np.uint16)
        assert cv2.imwrite(str(names[-1]), np.dstack([np.atleast_3d(codes.squeeze())[..., 0]] * 3))
    chosen = () if response is None else ("--response", response)
    done = camkit_command("merge", *names, "-o", tmp_path / "a.exr", "--times", "1,1/4", *chosen)
    assert done.code == 0, done.err
    said = "taken as linear light; if they are coded, add --response srgb" in done.out + done.err
    assert said == (response is None)


@pytest.mark.parametrize(
    ("files", "out", "told"),
    [
        (["night"], "a.png", "expected a name in .exr"),
        (["night", "other"], "a.exr", "2 brackets need a folder for their pictures as --out"),
        (["night", "deep/night"], "out", "two brackets would both give out/night.exr"),
        (["night", "long.png"], "a.exr", "got the folder night and the file long.png"),
        (["empty"], "a.exr", "empty holds no frames; expected RAW files or pictures (.3fr, .arw"),
        (["one"], "a.exr", "2 to 256 frames; got 1"),
        (["night"], "a.exr", "3 of 3 frames state no exposure time (0.png, 1.png, 2.png); add --t"),
    ],
)
def test_what_folders_lack_is_said(
    camkit_command, pictures, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, files, out, told
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("night", "other", "deep/night"):
        _folder(tmp_path / name)
    _folder(tmp_path / "one", (1,))
    (tmp_path / "empty").mkdir()
    done = camkit_command("merge", *files, "-o", out)
    assert done.code == ExitCode.USAGE, done.err
    assert told in done.err
    assert not Path(out).exists()
