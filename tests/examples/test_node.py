"""The example in JavaScript: photographs are read as camkit reads them, or refused by name."""

import hashlib
import json
import struct
import subprocess
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.reader import find_bundle, open_bundle
from camkit.runtime.raw import read_capture
from tests.dng_builder import build_dng
from tests.dng_factory import scene_mosaic, write_scene
from tests.examples.built_examples import PROGRAMS, build_examples
from tests.examples.portable_cases import (
    PortableCamera,
    difference_db,
    make_camera,
    write_photo,
)
from tests.lossless_jpeg import lossless_jpeg
from tests.tiff_factory import pack

SAME_DB: Final = 150.0
"""The same bits with the same onnxruntime; that of npm may be another version than that of pip."""


def _read(*paths: Path) -> list[dict[str, Any]]:
    build_examples()
    words = ["node", str(PROGRAMS / "read.mjs"), *map(str, paths)]
    made = subprocess.run(words, capture_output=True, text=True, check=True)
    return [json.loads(line) for line in made.stdout.splitlines()]


@pytest.fixture(scope="module")
def camera(tmp_path_factory: pytest.TempPathFactory) -> PortableCamera:
    build_examples()
    return make_camera("duet", "S", tmp_path_factory.mktemp("portable"))


def _develop(camera: PortableCamera, photo: Path, *options: str) -> FloatArray:
    """Return (3, h, w) light."""
    light = photo.with_suffix(".light")
    program = ["node", str(PROGRAMS / "develop.mjs"), str(camera.archive), str(photo)]
    words = [*program, str(photo.with_suffix(".png")), "--light", str(light), "--overwrite"]
    words += ["--size", "S", *options]
    subprocess.run(words, check=True, capture_output=True)
    height, width = cv2.imread(str(photo.with_suffix(".png"))).shape[:2]
    return np.fromfile(light, np.float32).reshape(3, height, width)


def test_words_are_explained_or_refused_in_a_line_and_no_picture_is_replaced(
    tmp_path: Path,
) -> None:
    build_examples()

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        program = ["node", str(PROGRAMS / "develop.mjs"), *map(str, words)]
        return subprocess.run(program, capture_output=True, text=True, check=False)

    told = run("--help")
    assert (told.returncode, told.stderr, "--white-balance R,G,B" in told.stdout) == (0, "", True)
    kept = tmp_path / "kept.png"
    kept.write_text("a picture")
    for fault, words in {
        "Unknown option '--gains'": ("--gains", "1,2"),
        "kept.png exists; add --overwrite": ("camera", "a.dng", kept),
    }.items():
        made = run(*words)
        assert (made.returncode, fault in made.stderr, made.stderr.count("\n")) == (1, True, 1)
    assert kept.read_text() == "a picture"


@pytest.mark.parametrize("name", ["typical", "saturated", "very_dark"])
def test_node_computes_what_python_computes(camera: PortableCamera, name: str) -> None:
    case = camera.cases[name]
    light = _develop(camera, case.photo)
    assert difference_db(light, case.light) >= SAME_DB
    if case.output is not None:
        assert float(np.abs(light - case.output).max()) <= case.allowed


def test_a_haze_is_found_as_python_finds_it(tmp_path: Path) -> None:
    build_examples()
    camera = make_camera("thin-plate", "S", tmp_path)
    case = camera.cases["saturated"]
    assert difference_db(_develop(camera, case.photo), case.light) >= SAME_DB


def test_a_plain_mosaic_is_developed_like_its_dng(camera: PortableCamera, tmp_path: Path) -> None:
    """Cropped at an odd place, where the cell of the sensor begins with another colour."""
    case = camera.cases["typical"]
    capture = read_capture(case.photo, isolate=False)
    assert capture.origin_px is not None
    assert capture.white_balance is not None
    mosaic, (x, y) = capture.samples[3:, 1:], capture.origin_px
    cv2.imwrite(str(tmp_path / "mosaic.png"), mosaic)
    gains = ",".join(map(repr, capture.white_balance))
    facts = ("--iso", "100", "--white-balance", gains, "--origin-px", f"{x + 1},{y + 3}")
    light = _develop(camera, tmp_path / "mosaic.png", *facts)
    assert light.shape[1:] == mosaic.shape
    inner = np.s_[:, 64:-64, 64:-64]
    # another grid of blocks and tiles: near the same, and nothing like it with colours swapped
    assert difference_db(light[inner], case.light[:, 3:, 1:][inner]) > 35


def test_blacks_that_differ_by_place_change_nothing_of_the_light(
    camera: PortableCamera, tmp_path: Path
) -> None:
    bundle = open_bundle(find_bundle("duet"))
    capture = read_capture(camera.cases["saturated"].photo, isolate=False)
    light = (capture.samples - 256.0).clip(0) / (4095 - 256)
    assert light.max() >= 1
    pictures = []
    for black in (np.full((2, 2), 4096), np.array([[4096, 9000], [500, 7000]])):
        below = np.tile(black, np.array(light.shape) // 2)
        samples = np.rint(below + light * (65535 - below)).astype(np.uint16)
        photo = tmp_path / f"{black[0, 1]}.dng"
        origin = capture.origin_px or (0, 0)
        gains = capture.white_balance
        write_photo(photo, bundle, samples, 100, gains, origin, black=black, white=65535)
        pictures.append(_develop(camera, photo))
    assert difference_db(*pictures) > 70


@pytest.mark.parametrize(("orientation", "quarters", "mirrored"), [(6, 3, False), (7, 1, True)])
def test_a_picture_is_turned_as_the_camera_was_held(
    camera: PortableCamera, tmp_path: Path, orientation: int, quarters: int, mirrored: bool
) -> None:
    photo, turned = camera.cases["very_dark"].photo, tmp_path / "turned.dng"
    data = photo.read_bytes()
    stated, wanted = (struct.pack("<HHII", 274, 3, 1, n) for n in (1, orientation))
    assert data.count(stated) == 1
    turned.write_bytes(data.replace(stated, wanted))
    pictures = []
    for path in (photo, turned):
        _develop(camera, path, "--bits", "16")
        pictures.append(cv2.imread(str(path.with_suffix(".png")), cv2.IMREAD_UNCHANGED))
    expected = np.rot90(pictures[0], quarters)
    assert np.array_equal(pictures[1], expected[:, ::-1] if mirrored else expected)


def _sha256(samples: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(samples, "<u2").tobytes()).hexdigest()


def _files(folder: Path) -> dict[str, Path]:
    """Return DNGs of every kind that is read."""
    scene = scene_mosaic()
    write_scene(folder / "own.dng", cfa="GBRG", orientation=6)
    black = np.array([[250, 251], [252, 253]])
    write_scene(folder / "cells.dng", black=black)
    area = {50829: ("long", (4, 6, 50, 72))}
    table = {50712: ("short", tuple(int(n * 1.5) for n in range(4096))), 50717: ("long", (6142,))}
    files = {"own": folder / "own.dng", "cells": folder / "cells.dng"}
    kinds: dict[str, dict[str, Any]] = {
        "big_endian": {"order": ">"},
        "twelve_bits": {"bits": 12, "pieces": [pack(scene, 12).tobytes()]},
        "fourteen_bits_in_strips": {
            "bits": 14,
            "rows_per_strip": 7,
            "pieces": [pack(scene[top : top + 7], 14).tobytes() for top in range(0, len(scene), 7)],
        },
        "tiles": {"chunk": (32, 48)},
        "active_area": {"tags": area},
        "table": {"tags": table},
        "jpeg": {"compression": 7, "pieces": [lossless_jpeg(scene)]},
        "jpeg_of_two": {"compression": 7, "pieces": [lossless_jpeg(scene, 6, components=2)]},
    }
    for name, kind in kinds.items():
        files[name] = build_dng(folder / f"{name}.dng", scene, **kind)
    return files


def test_dngs_are_read_as_camkit_reads_them(tmp_path: Path) -> None:
    files = _files(tmp_path)
    for facts in _read(*files.values()):
        capture = read_capture(Path(facts["path"]), isolate=False)
        assert facts.get("sha256") == _sha256(capture.samples), facts
        assert (facts["height"], facts["width"]) == capture.samples.shape
        assert facts["cfa"] == capture.cfa
        assert facts["black"] == capture.black_level.ravel().tolist()
        assert facts["white"] == capture.white_level
        assert facts["whiteBalance"] == pytest.approx(capture.white_balance, rel=1e-15)
        assert (facts.get("iso"), facts["orientation"]) == (capture.iso, capture.orientation)
        assert tuple(facts.get("origin", ())) == (capture.origin_px or ())
        assert facts.get("bundle") == capture.bundle_name
        assert ("noise" in facts) == (capture.noise is not None)
        if capture.noise is not None:
            assert facts["noise"]["shot"] == pytest.approx(capture.noise.shot)


@pytest.mark.parametrize("predictor", [1, 2, 3, 4, 5, 6, 7])
def test_every_predictor_and_restart_of_lossless_jpeg_is_undone(
    tmp_path: Path, predictor: int
) -> None:
    noise = np.random.default_rng(predictor).integers(0, 65536, (24, 40), dtype=np.uint16)
    pieces = [lossless_jpeg(noise, predictor, 1 + predictor % 2, restart_rows=5)]
    tags = {50717: ("long", (65535,))}
    path = build_dng(tmp_path / "noise.dng", noise, tags, compression=7, pieces=pieces)
    (facts,) = _read(path)
    assert facts.get("sha256") == _sha256(noise), facts


def test_a_grey_png_is_a_mosaic(tmp_path: Path) -> None:
    scene = scene_mosaic()
    cv2.imwrite(str(tmp_path / "mosaic.png"), scene)
    (facts,) = _read(tmp_path / "mosaic.png")
    assert facts["sha256"] == _sha256(scene)
    assert "iso" not in facts


def test_what_is_not_read_is_refused_by_its_name(tmp_path: Path) -> None:
    scene = scene_mosaic()
    planes = np.repeat(scene[..., None], 3, axis=2)
    baseline = cv2.imencode(".jpg", (scene >> 4).astype(np.uint8))[1].tobytes()
    x_trans = {33421: ("short", (6, 6)), 33422: ("byte", (0, 1, 2) * 12)}
    kinds: dict[str, dict[str, Any]] = {
        "Deflate": {"compression": 8},
        "lossy JPEG": {"compression": 34892},
        "with lossy JPEG": {"compression": 7, "pieces": [baseline]},
        "JPEG XL": {"compression": 52546},
        "method 7777": {"compression": 7777},
        "linear": {"samples": planes},
        "floating-point": {"samples": (scene / 4095).astype(np.float32)},
        "no Bayer pattern": {"tags": x_trans},
        "cut off": {},
        "fewer samples": {"pieces": [bytes(100)]},
    }
    paths = []
    for number, kind in enumerate(kinds.values()):
        paths.append(build_dng(tmp_path / f"{number}.dng", **({"samples": scene} | kind)))
    cut = paths[list(kinds).index("cut off")]
    cut.write_bytes(cut.read_bytes()[:-1000])
    (tmp_path / "text.dng").write_text("no photograph at all")
    (tmp_path / "empty.dng").touch()
    names = [*kinds, "no TIFF or DNG", "nearly"]
    for name, facts in zip(
        names, _read(*paths, tmp_path / "text.dng", tmp_path / "empty.dng"), strict=True
    ):
        assert name in facts.get("refused", ""), (name, facts)


def test_a_damaged_file_is_read_or_refused_and_never_an_error(tmp_path: Path) -> None:
    scene, rng = scene_mosaic(), np.random.default_rng(1)
    jpeg = {"compression": 7, "pieces": [lossless_jpeg(scene, 6, components=2)]}
    cv2.imwrite(str(tmp_path / "grey.png"), scene)
    sound = [
        (tmp_path / "grey.png").read_bytes(),
        build_dng(tmp_path / "jpeg.dng", scene, **jpeg).read_bytes(),
        build_dng(tmp_path / "tiles.dng", scene, chunk=(32, 48)).read_bytes(),
    ]
    paths = [tmp_path / f"damaged_{number}" for number in range(120)]
    for number, path in enumerate(paths):
        data = bytearray(sound[number % len(sound)])
        reach = len(data) if number % 2 else 700  # the header alone, or anywhere
        for place in rng.integers(0, reach, 4):
            data[place] = rng.integers(0, 256)
        path.write_bytes(data[: rng.integers(1, len(data))] if number % 7 == 0 else data)
    answers = _read(*paths)
    assert len(answers) == len(paths)
    assert sum("refused" in answer for answer in answers) > len(paths) / 4
