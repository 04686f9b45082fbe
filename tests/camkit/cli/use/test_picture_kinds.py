"""Pictures of every kind on the command line: grey ones, windows, kinds that are refused."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image

from camkit.runtime.files.picture import read_scene
from camkit.runtime.write_options import WriteOptions
from tests.data_folder import data_path

HIGH, WIDE = 96, 128
Y, X = np.mgrid[:HIGH, :WIDE]
LIGHT = (0.3 + 0.2 * np.sin(X / 9) * np.cos(Y / 13)).astype(np.float32)
GREY = ("jpg", "8.png", "16.png", "8.tif", "16.tif", "float.tif", "exr")


def write_grey(path: Path, kind: str, light: np.ndarray = LIGHT) -> Path:
    """Write one channel; kinds of 8 bits are coded in sRGB by a power that is near."""
    path = path.with_suffix(f".{kind}")
    eight = np.rint(255 * light ** (1 / 2.2)).astype(np.uint8)
    if kind == "exr":
        header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
        OpenEXR.File(header, {"Y": light}).write(str(path))
    elif kind == "float.tif":
        tifffile.imwrite(path, light)
    elif "16" in kind:
        cv2.imwrite(str(path), np.rint(65535 * light).astype(np.uint16))
    else:
        Image.fromarray(eight).save(path, quality=98)
    return path


@pytest.mark.parametrize("kind", GREY)
def test_grey_pictures_are_developed(tmp_path: Path, camkit_command: Any, kind: str) -> None:
    path = write_grey(tmp_path / "grey", kind)
    done = camkit_command("process", path, "--bundle", "none", "--out-dir", tmp_path / "out")
    assert done.code == 0, done.err
    found = read_scene(tmp_path / "out" / f"{path.stem}.exr")
    assert np.abs(found - LIGHT).max() < 0.02
    assert np.ptp(found, axis=0).max() < 1e-3


@pytest.mark.parametrize("kind", GREY)
@pytest.mark.parametrize("command", ["deglare", "merge", "simulate"])
def test_grey_pictures_are_taken_by_other_commands(
    tmp_path: Path, camkit_command: Any, kind: str, command: str
) -> None:
    path = write_grey(tmp_path / "grey", kind)
    other = write_grey(tmp_path / "darker", kind, LIGHT / 4)
    told = {
        "deglare": ("process", path, "--bundle", "deglare", "--out-dir", tmp_path / "out"),
        "merge": ("merge", path, other, "--times", "1,0.25", "-o", tmp_path / "out.exr"),
        "simulate": ("simulate", path, "--bundle", "duet", "-o", tmp_path / "out.dng"),
    }
    done = camkit_command(*told[command])
    assert done.code == 0, done.err


@pytest.mark.parametrize(("name", "suffix"), [("jpg", ".jpg"), ("tif", ".tif"), ("jpeg", ".jpg")])
def test_formats_are_known_by_their_suffix_too(
    tmp_path: Path, camkit_command: Any, name: str, suffix: str
) -> None:
    path = write_grey(tmp_path / "grey", "jpg")
    done = camkit_command(
        *("process", path, "--bundle", "none", "--out-dir", tmp_path / "out", "--format", name)
    )
    assert done.code == 0, done.err
    assert (tmp_path / "out" / f"grey{suffix}").is_file()
    assert WriteOptions(format=name) == WriteOptions(format={"jpg": "jpeg"}.get(name, name))


def test_a_mosaic_without_its_options_is_asked_about(tmp_path: Path, camkit_command: Any) -> None:
    noise = np.random.default_rng(1).normal(0, 200, (HIGH, WIDE))
    cells = np.tile([[0.5, 1.0], [1.0, 0.7]], (HIGH // 2, WIDE // 2))
    cv2.imwrite(str(tmp_path / "m.png"), (60000 * LIGHT * cells + noise + 999).astype(np.uint16))
    done = camkit_command("process", tmp_path / "m.png", "--bundle", "none", "--out-dir", tmp_path)
    assert done.code == 1
    assert "--mosaic RGGB with --black-level and --white-level" in done.err


@pytest.mark.parametrize("square_px", [1, 2, 3, 8])
@pytest.mark.parametrize("dithered", [False, True])
def test_fine_patterns_are_no_mosaics(
    tmp_path: Path, camkit_command: Any, square_px: int, dithered: bool
) -> None:
    board = ((X // square_px + Y // square_px) % 2 * 200 + 20).astype(np.uint8)
    picture = Image.fromarray(board)
    if dithered:
        picture = Image.fromarray(np.rint(255 * LIGHT).astype(np.uint8)).convert("1")
    picture.save(tmp_path / "a.png")
    done = camkit_command(
        *("process", tmp_path / "a.png", "--bundle", "none", "--out-dir", tmp_path / "out")
    )
    assert done.code == 0, done.err


def test_windows_stay_in_the_exr_and_are_told_for_other_formats(
    tmp_path: Path, camkit_command: Any
) -> None:
    source = data_path("reports/exr_window_a.exr")
    for name in ("exr", "png"):
        done = camkit_command(
            *("process", source, "--bundle", "none", "--out-dir", tmp_path, "--format", name),
            *("--json", "--overwrite"),
        )
        assert any("data window" in note for note in json.loads(done.out)["warnings"])
    with OpenEXR.File(str(tmp_path / "exr_window_a.exr"), header_only=True) as file:
        header = dict(file.header())
    assert np.array_equal(header["dataWindow"], ([20, 10], [299, 209]))
    assert np.array_equal(header["displayWindow"], ([0, 0], [319, 239]))
    half = read_scene(source).astype(np.float16)
    assert np.array_equal(read_scene(tmp_path / "exr_window_a.exr"), half)


def test_a_deep_file_costs_one_line_and_the_next_is_made(
    tmp_path: Path, camkit_command: Any
) -> None:
    files = [data_path(f"reports/exr_{name}.exr") for name in ("deep", "good")]
    done = camkit_command("process", *files, "--bundle", "none", "--out-dir", tmp_path)
    assert done.code == 1
    assert len([line for line in done.err.splitlines() if "deep" in line]) == 1
    assert (tmp_path / "exr_good.exr").is_file()
    assert not (tmp_path / "exr_deep.exr").exists()
