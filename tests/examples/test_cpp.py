"""The reader in C++: it builds without a warning, and has the bits of the reader in Python."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.golden import golden_from_bytes
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import GOLDEN, Bundle, find_bundle, open_bundle
from camkit.runtime.portable.package import write_portable
from tests.examples.portable_cases import ROOT, python_reader

CPP: Final = ROOT / "examples" / "cpp"
SIZE: Final = "S"
ODD_DB: Final = 45.0
"""To camkit, whose places are others by 1/32 px before format 2.12; red for green leaves 22."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenCamera:
    """A bundle, its graphs, and the reader in Python on them."""

    bundle: Bundle
    folder: Path
    reader: Any


@cache
def cpp_program() -> Path:
    """Return the built program; skip the test where it cannot be built."""
    for tool in ("cmake", "c++"):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not there; install it to test the reader in C++")
    brought = _run("bash", str(CPP / "headers.sh"))
    build = CPP / "build"
    flags = "-O2 -Wall -Wextra -Werror"
    made = _run(
        *("cmake", "-S", str(CPP), "-B", str(build), "-DCMAKE_BUILD_TYPE=None"),
        *(f"-DONNXRUNTIME_PYTHON={sys.executable}", f"-DCMAKE_CXX_FLAGS={flags}"),
    )
    if "onnxruntime_c_api.h is not there" in made.stderr:
        pytest.skip(f"the headers of onnxruntime are not there: {brought.stderr[-200:]}")
    assert made.returncode == 0, made.stdout + made.stderr
    made = _run("cmake", "--build", str(build))
    assert made.returncode == 0, made.stdout + made.stderr
    return build / "camkit_develop"


def _run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, timeout=240, check=False)


@pytest.fixture(scope="module", params=["duet", "duet-joint"])
def camera(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> WrittenCamera:
    return _written(request.param, tmp_path_factory.mktemp(request.param) / "camera")


def _written(name: str, folder: Path) -> WrittenCamera:
    cpp_program()
    bundle = open_bundle(find_bundle(name))
    write_portable(bundle, folder, (SIZE,))
    return WrittenCamera(bundle=bundle, folder=folder, reader=python_reader(folder, SIZE))


def _developed(
    camera: WrittenCamera, case: GoldenCase, *pairs: Path, options: tuple[str, ...] = ()
) -> None:
    gains = ",".join(map(repr, case.white_balance or (1.0, 1.0, 1.0)))
    origin = ",".join(map(str, case.origin_px))
    about = ("--size", SIZE, "--iso", repr(case.iso), "--white-balance", gains)
    words = (*about, "--origin-px", origin, *options, *map(str, pairs))
    made = _run(str(cpp_program()), str(camera.folder), *words)
    assert made.returncode == 0, made.stderr


def read_pfm(path: Path) -> FloatArray:
    """Return (3, h, w) light of a PFM."""
    kind, sides, scale, samples = path.read_bytes().split(b"\n", 3)
    width, height = map(int, sides.split())
    assert (kind, float(scale)) == (b"PF", -1.0)
    picture = np.frombuffer(samples, "<f4").reshape(height, width, 3)[::-1]
    return np.ascontiguousarray(picture.transpose(2, 0, 1))


def test_golden_cases_have_the_bits_of_the_reader_in_python(
    camera: WrittenCamera, tmp_path: Path
) -> None:
    _compare(camera, tmp_path, camera.bundle.manifest.golden)


def test_a_haze_is_found_with_the_bits_of_the_reader_in_python(tmp_path: Path) -> None:
    camera = _written("thin-plate", tmp_path / "camera")
    cases = [case for case in camera.bundle.manifest.golden if case.name == "saturated"]
    _compare(camera, tmp_path, cases)


def _compare(camera: WrittenCamera, tmp_path: Path, cases: Sequence[GoldenCase]) -> None:
    arrays = golden_from_bytes(camera.bundle.member(GOLDEN))
    for case in cases:
        mosaic, picture = tmp_path / "mosaic.npy", tmp_path / "picture.pfm"
        np.save(mosaic, arrays[case.name].capture)
        _developed(camera, case, mosaic, picture)
        gains = case.white_balance or (1.0, 1.0, 1.0)
        light = camera.reader.develop(arrays[case.name].capture, case.iso, gains, case.origin_px)
        made = read_pfm(picture)
        np.testing.assert_array_equal(made, light, err_msg=case.name)
        if all(json.loads((camera.folder / "portable.json").read_text())["agrees"].values()):
            output = arrays[case.name].outputs["image"][SIZE]
            allowed = case.atol + case.rtol * max(1.0, float(np.abs(output).max()))
            assert float(np.abs(made - output).max()) <= allowed, case.name


@pytest.fixture(scope="module")
def duet(tmp_path_factory: pytest.TempPathFactory) -> WrittenCamera:
    return _written("duet", tmp_path_factory.mktemp("one") / "camera")


def _scene(height: int, width: int) -> np.ndarray[Any, Any]:
    """Return a mosaic with clipped samples."""
    y, x = np.mgrid[:height, :width]
    light = 1200 + 700 * np.sin(x / 7) * np.cos(y / 11)
    light += np.random.default_rng(1).normal(0, 20, light.shape)
    light[height // 2 : height // 2 + 5, : width // 2] = 5000
    return np.clip(light, 0, 4095).astype(np.uint16)


def test_captures_after_each_other_share_a_camera_and_keep_their_bits(
    duet: WrittenCamera, tmp_path: Path
) -> None:
    case = GoldenCase(name="odd", iso=530.0, origin_px=(2904, 1802), white_balance=(2.0, 1.0, 1.6))
    wide, high = _scene(37, 530), _scene(301, 1)
    wide.astype("<u2").tofile(tmp_path / "wide.raw")
    np.save(tmp_path / "high.npy", high)
    pairs = [
        tmp_path / name for name in ("wide.raw", "a.pfm", "high.npy", "b.pfm", "wide.raw", "c.pfm")
    ]
    _developed(duet, case, *pairs, options=("--size-px", "530,37", "--straight", "no"))
    about = (case.iso, case.white_balance, case.origin_px)
    for mosaic, names in ((wide, "ac"), (high, "b")):
        light = duet.reader.develop(mosaic, *about, straight=False)
        for name in names:
            np.testing.assert_array_equal(read_pfm(tmp_path / f"{name}.pfm"), light)


def test_a_crop_from_an_odd_pixel_begins_with_another_colour(
    duet: WrittenCamera, tmp_path: Path
) -> None:
    mosaic, gains, origin = np.minimum(_scene(90, 121), 3000), (2.0, 1.0, 1.6), (4301, 2703)
    np.save(tmp_path / "odd.npy", mosaic)
    case = GoldenCase(name="odd", iso=400.0, origin_px=origin, white_balance=gains)
    _developed(duet, case, tmp_path / "odd.npy", tmp_path / "odd.pfm")
    pipeline = camkit.load("duet", size=SIZE, threads=1)
    light = pipeline.process_array(mosaic, iso=400.0, white_balance=gains, origin_px=origin)
    error = np.mean((read_pfm(tmp_path / "odd.pfm") - light) ** 2)
    assert -10 * np.log10(error) > ODD_DB


def test_damaged_cameras_and_files_are_refused_by_their_fault(
    duet: WrittenCamera, tmp_path: Path
) -> None:
    about, tables = (duet.folder / name for name in ("portable.json", "portable.safetensors"))
    np.save(tmp_path / "float.npy", np.zeros((8, 8), np.float32))
    (tmp_path / "short.raw").write_bytes(bytes(100))
    folders = {name: tmp_path / name for name in ("cut", "newer", "bare", "bent", "missing")}
    for folder in folders.values():
        folder.mkdir()
        for path in duet.folder.iterdir():
            os.link(path, folder / path.name)
        (folder / about.name).unlink()
    text = about.read_text()
    (folders["cut"] / about.name).write_text(text[:700])
    (folders["newer"] / about.name).write_text(text.replace('version": 1', 'version": 9'))
    (folders["bare"] / about.name).write_text(text.replace('"tile_px"', '"px"'))
    (folders["bent"] / about.name).write_text(text)
    (folders["bent"] / tables.name).unlink()
    (folders["bent"] / tables.name).write_bytes(tables.read_bytes()[:-4])
    raw = ("--size-px", "30,20", str(tmp_path / "short.raw"))
    faults = {
        "damaged JSON at byte 700": (folders["cut"], *raw),
        "another version": (folders["newer"], *raw),
        "is damaged": (folders["bent"], *raw),
        "cannot read": (folders["missing"], *raw),
        "no network of size M; it has S": (duet.folder, "--size", "M", *raw),
        "100 bytes of samples, not 1200": (duet.folder, *raw),
        "no array of uint16": (duet.folder, str(tmp_path / "float.npy")),
        "the manifest has no tile_px": (
            *(folders["bare"], "--size-px", "10,5", str(tmp_path / "short.raw")),
        ),
        "--iso takes 1 numbers": (duet.folder, "--iso", "fast", *raw),
        "iso must be above 0": (
            *(duet.folder, "--iso", "-1", "--size-px", "10,5", str(tmp_path / "short.raw")),
        ),
    }
    for fault, words in faults.items():
        size = () if "--size" in words else ("--size", SIZE)
        made = _run(str(cpp_program()), *map(str, words), str(tmp_path / "out.pfm"), *size)
        assert (made.returncode, fault in made.stderr) == (1, True), (fault, made.stderr)
    assert not (tmp_path / "out.pfm").exists()
