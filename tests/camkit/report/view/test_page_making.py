"""Results on a page: which are found, what stands on the page, and what is refused by its name."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import camkit
from camkit.errors import ContractError, DecodeError
from camkit.report.view.cell_map import spared_cells
from camkit.report.view.picture_light import find_original, read_result
from camkit.report.view.result_search import find_results
from camkit.report.view.view_crops import choose_crops
from camkit.runtime.geometry.turning import turn
from camkit.runtime.output.sidecar import sidecar_path
from tests.dng_factory import write_scene

HALF_FLOAT_STEP = 1e-3
"""Of floats of 16 bits near white, through a colour matrix."""
FORMATS = ("exr", "tiff", "png", "jpeg", "dng")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of the same capture in every format."""
    top = tmp_path_factory.mktemp("results")
    for name in FORMATS:
        write_scene(top / f"{name}.dng")
        (made,) = camkit.process(
            top / f"{name}.dng", bundle="none", out_dir=top / "out", format=name
        )
        assert made.status == "ok", made.error
    return top / "out"


def _text(folder: Path, tmp_path: Path, **options: object) -> str:
    page = camkit.view(folder, tmp_path / "page.html", **options)
    return page.path.read_text(encoding="utf-8")


def test_every_format_has_a_slider_and_the_page_needs_nothing_else(
    folder: Path, tmp_path: Path
) -> None:
    text = _text(folder, tmp_path)
    assert text.count('class="split"') == len(FORMATS)
    assert text.count("only developed") >= len(FORMATS)
    assert not re.findall(r'(?:src|href)="(?!data:|#)', text)
    stated = float(re.findall(r"This page has ([\d.]+) MB", text)[0])
    assert stated == pytest.approx(len(text.encode()) / 1e6, abs=0.06)


def test_a_sidecar_its_picture_and_its_folder_are_one_result(folder: Path) -> None:
    results = find_results([folder / "png.png", folder / "png.camkit.json", folder])
    names = [result.path.name for result in results]
    assert sorted(names) == ["dng.dng", "exr.exr", "jpeg.jpg", "png.png", "tiff.tif"]
    assert not any(result.notes for result in results)


@pytest.mark.parametrize(
    "options",
    [
        {"color": "acescg"},
        {"color": "camera", "scale": "1/2"},
        {"format": "tiff", "linear": True, "exposure_ev": 0.5, "white_balance": (2.0, 1.0, 1.5)},
        {"format": "dng", "exposure_ev": -1.0},
        {"format": "png"},
    ],
    ids=str,
)
def test_the_capture_of_a_developed_picture_is_that_picture(
    tmp_path: Path, options: dict[str, Any]
) -> None:
    """Whatever its format, colour space, exposure and orientation."""
    write_scene(tmp_path / "a.dng", orientation=6)
    camkit.process(tmp_path / "a.dng", bundle="none", out_dir=tmp_path / "out", **options)
    (result,) = find_results([tmp_path / "out"])
    after = read_result(result.path)
    before = find_original(result, None, after.shape[1:]).light
    assert before is not None
    assert after.shape[1] > after.shape[2]
    difference = np.abs(np.clip(after, 0, 1) - np.clip(before, 0, 1))
    assert float(difference.max()) < HALF_FLOAT_STEP


def _copied(folder: Path, tmp_path: Path, name: str = "png.png") -> Path:
    path = tmp_path / name
    path.write_bytes((folder / name).read_bytes())
    sidecar_path(path).write_bytes(sidecar_path(folder / name).read_bytes())
    return path


@pytest.mark.parametrize("fault", ["gone", "changed"])
def test_without_its_capture_a_line_says_why_and_before_may_be_given(
    folder: Path, tmp_path: Path, fault: str
) -> None:
    path = _copied(folder, tmp_path)
    record = json.loads(sidecar_path(path).read_text())
    record["input"] = str(tmp_path / "moved.dng")
    if fault == "changed":
        (tmp_path / "moved.dng").write_bytes(b"another")
    sidecar_path(path).write_text(json.dumps(record))
    text = _text(path, tmp_path)
    assert 'class="split"' not in text
    assert {"gone": "is not there", "changed": "its hash differs"}[fault] in text
    given = _text(path, tmp_path, before_file=folder / "exr.exr", overwrite=True)
    assert 'class="split"' in given
    assert "Before is exr.exr" in given


def test_a_capture_that_is_another_is_shown_with_a_note(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.dng"
    write_scene(other, black=255)
    page = camkit.view(folder / "png.png", tmp_path / "page.html", before_file=other)
    (note,) = page.notes
    assert "other.dng is not the capture png.dng that the sidecar names: its hash differs" in note
    text = page.path.read_text(encoding="utf-8")
    assert note.removeprefix("png.png: ") in text
    assert 'class="split"' in text
    own = folder.parent / "png.dng"
    for file in (own, folder / "exr.exr"):  # the capture itself, and a picture on purpose
        page = camkit.view(folder / "png.png", page.path, before_file=file, overwrite=True)
        assert not page.notes


def test_a_capture_itself_is_shown_developed(folder: Path, tmp_path: Path) -> None:
    text = _text(folder.parent / "png.dng", tmp_path)
    assert "RAW files are developed, not restored" in text
    assert "Its codes are read" not in text


def test_what_is_doubtful_is_said(folder: Path, tmp_path: Path) -> None:
    path = _copied(folder, tmp_path)
    path.write_bytes((folder / "tiff.tif").read_bytes())
    assert "the file was changed" in _text(path, tmp_path)
    sidecar_path(path).unlink()
    assert "does not lie beside it" in _text(path, tmp_path, overwrite=True)


@pytest.mark.parametrize(
    ("name", "data", "word"),
    [
        ("a.png", b"", "a.png"),
        ("a.camkit.json", b"[1]", "a.camkit.json is damaged"),
        ("a.npz", b"PK", "a.npz"),
        ("a.mp4", b"film", "a.mp4"),
    ],
)
def test_what_is_no_result_is_refused_by_its_name(
    tmp_path: Path, name: str, data: bytes, word: str
) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(DecodeError, match=re.escape(word)):
        camkit.view(tmp_path / name, tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


def test_wrong_wishes_are_refused(folder: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(DecodeError, match="holds no result"):
        camkit.view(empty, tmp_path / "page.html")
    with pytest.raises(DecodeError, match="no such file"):
        camkit.view(tmp_path / "gone.exr", tmp_path / "page.html")
    with pytest.raises(ContractError, match="lies outside"):
        camkit.view(folder / "png.png", tmp_path / "page.html", crops=[(80, 0)])
    with pytest.raises(ContractError, match="for one result"):
        camkit.view(folder, tmp_path / "page.html", before_file=folder / "png.png")
    (tmp_path / "page.html").touch()
    with pytest.raises(ContractError, match="exists"):
        camkit.view(folder, tmp_path / "page.html")


def test_a_large_picture_is_shown_small_with_its_places_at_full_size() -> None:
    light = np.full((3, 1000, 1500), 0.2, np.float32)
    light[:, 300, 400] = 9.0
    before = light.copy()
    before[:, 700:800, 1100:1300] = 0.1
    crops = {crop.name: crop for crop in choose_crops(light, before, [(1499, 999)])}
    whole = crops["Whole picture, 1 : 2"]
    assert whole.of(light).shape == (3, 500, 750)
    for name, (x, y) in {
        "Middle": (750, 500),
        "Strongest change": (1200, 750),
        "Brightest light": (400, 300),
        "At 1499, 999": (1499, 999),
    }.items():
        crop = crops[name]
        assert crop.of(light).shape == (3, 480, 640)
        assert crop.left <= x < crop.left + crop.width
        assert crop.top <= y < crop.top + crop.height


@pytest.mark.parametrize("orientation", range(1, 9))
def test_cells_turn_with_their_picture(orientation: int) -> None:
    """Rectangles drawn on the upright picture cover the pixels of their tiers."""
    rows = ["PF", "SW", "FF"]
    letters = np.array([list(row) for row in rows]).repeat(4, 0).repeat(4, 1)[:11, :7]
    upright = turn(letters, orientation)
    record = {"orientation": orientation, "plan": {"cells": {"side_px": 4, "rows": rows}}}
    cells = spared_cells(record, upright.shape)
    assert cells is not None
    painted = np.full(upright.shape, "F")
    for left, top, width, height, letter in cells:
        painted[top : top + height, left : left + width] = letter
    assert np.array_equal(painted, upright)
    assert spared_cells(record, (50, 50)) is None
