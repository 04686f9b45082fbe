"""Results of unusual sizes, names, sidecars and archives: a true page, or a refusal by name."""

import contextlib
import copy
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import OpenEXR
import pytest

import camkit
from camkit.errors import ContractError, DecodeError
from camkit.report.view.picture_light import find_original, read_result
from camkit.report.view.record_words import record_lines
from camkit.report.view.result_page import result_page
from camkit.report.view.result_search import ViewedResult, find_results, read_record
from camkit.runtime.output.sidecar import sidecar_path
from tests.dng_factory import write_scene

CHANGES: Final = (None, "word", "a" * 5000, "", -1, [], {"word": None}, float("nan"))


def _write_png(path: Path, height: int = 20, width: int = 30) -> Path:
    codes = np.random.default_rng(0).integers(0, 256, (height, width, 3), dtype=np.uint8)
    is_encoded, data = cv2.imencode(".png", codes)
    assert is_encoded
    path.write_bytes(data.tobytes())
    return path


def _write_exr(path: Path, light: np.ndarray) -> Path:
    OpenEXR.File({}, {"RGB": np.ascontiguousarray(light, np.float32)}).write(str(path))
    return path


def _page(tmp_path: Path, *files: Path, **options: Any) -> str:
    out = tmp_path / "page.html"
    return camkit.view(list(files), out, overwrite=True, **options).path.read_text("utf-8")


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 3000), (3000, 1), (2, 2000), (7, 1281)])
def test_a_strip_is_shown_whole(tmp_path: Path, height: int, width: int) -> None:
    path = _write_png(tmp_path / "a.png", height, width)
    text = _page(tmp_path, path, before_file=path)
    assert f"The picture has {width} x {height} px." in text
    light = np.random.default_rng(0).random((height, width, 3)) * 5
    exr = _page(tmp_path, _write_exr(tmp_path / "a.exr", light))
    assert '"height": 0' not in text + exr
    assert '"width": 0' not in text + exr


def test_light_as_bright_as_floats_go_is_shown(tmp_path: Path) -> None:
    light = np.full((4, 5, 3), 3e38)
    assert "3e+38 times white" in _page(tmp_path, _write_exr(tmp_path / "a.exr", light))


def test_a_name_that_is_no_utf_8_is_shown(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"l\xe9ns.png")
    try:
        _write_png(path)
    except OSError:
        pytest.skip("the file system takes names of UTF-8 alone")
    assert "l\\udce9ns.png" in _page(tmp_path, path)


def test_a_page_never_replaces_a_result(tmp_path: Path) -> None:
    path = _write_png(tmp_path / "a.png")
    before = path.read_bytes()
    with pytest.raises(ContractError, match=r"NAME\.html"):
        camkit.view(path, path, overwrite=True)
    assert path.read_bytes() == before


def test_a_page_that_grows_too_large_is_refused_at_the_first_result_too_many(
    tmp_path: Path,
) -> None:
    paths = [_write_png(tmp_path / f"{number}.png", 100, 100) for number in range(9)]
    results = find_results(paths)
    with pytest.raises(ContractError, match=r"3\.png, result 4 of 9"):
        result_page(results, None, (), most_bytes=150_000)


@pytest.fixture(scope="module")
def developed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a picture whose exposure and white balance are not those of its capture."""
    folder = tmp_path_factory.mktemp("developed")
    write_scene(folder / "a.dng", orientation=6)
    (made,) = camkit.process(
        folder / "a.dng", bundle="none", out_dir=folder / "out",
        exposure_ev=1.0, white_balance=(2.0, 1.0, 1.5),
    )  # fmt: skip
    assert made.status == "ok", made.error
    return folder / "out" / "a.exr"


def test_a_capture_that_moved_is_developed_as_the_result_was(
    developed: Path, tmp_path: Path
) -> None:
    moved = tmp_path / "elsewhere.dng"
    moved.write_bytes((developed.parent.parent / "a.dng").read_bytes())
    (result,) = find_results([developed])
    after = read_result(result.path)
    own, given = (find_original(result, file, after.shape[1:]) for file in (None, moved))
    assert own.light is not None
    assert given.light is not None
    np.testing.assert_array_equal(given.light, own.light)
    assert "as in the result" in given.note


def _leaves(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if place:
        yield place
    items = enumerate(value[:1]) if isinstance(value, list) else ()
    for key, inner in value.items() if isinstance(value, dict) else items:
        yield from _leaves(inner, (*place, key))


def test_an_edited_sidecar_is_read_or_refused_by_name(developed: Path, tmp_path: Path) -> None:
    """Put another value in every key that a page reads; none may end in a traceback."""
    record = json.loads(sidecar_path(developed).read_text())
    record["plan"] |= {
        "cells": {"side_px": 20, "rows": ["PFFF", "SWFF", "FFFF"]},
        "decisions": [
            {"what": "size", "choice": "M", "reason": "r", "saving_s": 0.1, "cost_db": 0.0}
        ],
        "envelope": {"seen": {"side_px": 60.0}, "outside": []},
    }
    record |= {
        "seconds": {"decode": 1.0},
        "options": {**dict.fromkeys(("mosaic", "origin_px", "white_balance")), "of_kind": {}},
        "metadata": {"lens_model": "50 mm"},
        "hdr": {"regions": 1, "saturated_fraction": 0.1, "unexplained": 0.1},
        "spad": {"photons": 5.0, "pixels": 7, "valid": [3]},
    }
    path = tmp_path / "a.exr"
    path.write_bytes(developed.read_bytes())
    read = refused = 0
    for place in [*_leaves(record)]:
        for change in CHANGES:
            edited = copy.deepcopy(record)
            inner = edited
            for key in place[:-1]:
                inner = inner[key]
            inner[place[-1]] = change
            sidecar_path(path).write_text(json.dumps(edited))
            try:
                facts = read_record(sidecar_path(path))
            except DecodeError as error:
                refused += str(sidecar_path(path)) in str(error)
                continue
            # a capture that is not there: development has tests of its own
            result = ViewedResult(path=path, record={**facts, "input_sha256": ""})
            record_lines(facts)
            result_page([result], None, (), most_bytes=10**8)
            read += 1
    assert min(read, refused) > 50


@pytest.mark.parametrize(
    "change",
    [{"exposure_ev": "word"}, {"white_balance": [1.0]}, {"demosaic": []}],
    ids=str,
)
def test_an_option_that_was_edited_is_a_line_in_place_of_the_slider(
    developed: Path, change: dict[str, Any]
) -> None:
    (result,) = find_results([developed])
    assert result.record is not None
    edited = {**result.record, "options": {**result.record["options"], **change}}
    original = find_original(ViewedResult(path=result.path, record=edited), None, (80, 60))
    assert original.light is None
    assert original.note.startswith("There is no before")


@pytest.mark.parametrize(
    "arrays",
    [
        {"depth_m": np.array("word")},
        {"depth_m": np.zeros((0, 5))},
        {"depth_m": np.ones((4, 5)), "sigma_ps": np.ones((2, 2))},
        {"depth_m": np.ones((2, 4, 5)), "valid": np.ones((4, 5), bool)},
        {"intensity": np.full((4, 5), np.nan)},
        {"intensity": np.ones((4, 5), complex)},
        {"frames": np.zeros((0, 4, 5))},
        {"transient": np.ones((6, 4, 5)), "time_ps": np.arange(5)},
    ],
    ids=lambda arrays: " ".join(f"{name} {values.shape}" for name, values in arrays.items()),
)
def test_arrays_that_do_not_belong_together_are_refused(
    tmp_path: Path, arrays: dict[str, Any]
) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(DecodeError, match=r"a\.npz"):
        _page(tmp_path, tmp_path / "a.npz")


def test_a_damaged_archive_is_refused_wherever_the_damage_lies(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez_compressed(path, depth_m=np.random.default_rng(0).random((20, 30)))
    whole = path.read_bytes()
    for place in range(0, len(whole) - 40, len(whole) // 50):
        path.write_bytes(whole[:place] + bytes(40) + whole[place + 40 :])
        with contextlib.suppress(DecodeError):
            _page(tmp_path, path)


def test_the_words_of_a_map_are_those_of_the_whole_map(tmp_path: Path) -> None:
    """Also where a page shows one of several pixels."""
    depth = np.full((30, 2000), np.nan)
    depth[:, ::2] = 1.5
    depth[0, 0] = np.inf
    np.savez(tmp_path / "a.npz", depth_m=depth)
    text = _page(tmp_path, tmp_path / "a.npz")
    assert "The map has 2000 x 30 px, 50.0% of them valid" in text
    assert "One of 2 px along each side is shown." in text


@pytest.mark.parametrize(("photons", "white"), [(0, 1), (1, 1), (40, 40)])
def test_a_picture_with_hardly_a_photon_has_a_white(
    tmp_path: Path, photons: int, white: int
) -> None:
    values = np.zeros((40, 50), np.uint32)
    values[7, 9] = photons
    np.savez(tmp_path / "a.npz", intensity=values)
    assert f"White is {white} photons." in _page(tmp_path, tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("seconds", "text"), [(1 / 50, "1/50 s"), (0.25, "1/4 s"), (0.4, "0.4 s"), (2.0, "2 s")]
)
def test_an_exposure_is_said_as_it_is(developed: Path, seconds: float, text: str) -> None:
    record = read_record(sidecar_path(developed))
    lines = record_lines({**record, "exposure_time_s": seconds})
    assert any(f"exposure {text}" in line for line in lines)
