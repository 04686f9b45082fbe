"""A camera without a lens, with a stage of its own, goes through the ordinary commands.

Its bundle is made of a real diffuser's response to a point light, and takes a real capture: see
`tests/lensless_camera`.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray

import camkit
from camkit.bundle.optics import FrozenPsfOptics
from camkit.bundle.plane import Plane
from camkit.bundle.stages import JoinError, Parts
from camkit.cli.exit_code import ExitCode
from camkit.runtime.cancel import Cancelled
from tests.data_folder import data_path
from tests.installed_package import ROOT
from tests.lensless_camera import bundle as maker
from tests.lensless_camera.entry import LenslessAdmm
from tests.lensless_camera.install import lensless_installed  # noqa: F401
from tests.lensless_camera.test_solver import speckle

PITCH_UM, WHITE_DN = 3.0, 65520.0
HAND: dict[str, Any] = {
    "iterations": 60,
    "positive_penalty": 100,
    "gradient_penalty": 10,
    "tv": 0.01,
    "white": 8,
}
FULL = HAND | {"positive_penalty": 200, "gradient_penalty": 20, "tv": 0.02}

pytestmark = pytest.mark.usefixtures("lensless_installed")


def _real(shrink: int, folder: Path, **settings: Any) -> tuple[Path, Path]:
    """Write bundle and capture of the real camera, means over squares of `shrink` pixels."""
    point, hand = (
        _shrunk(tifffile.imread(data_path(f"lensless/{name}.tif")), shrink)
        for name in ("psf_sample", "rawdata_hand_sample")
    )
    # nothing but stray light falls into this corner
    dark = point[5:15, 5:15] if shrink == 1 else point[2 : 15 // shrink, 2 : 15 // shrink]
    black_dn = float(dark.mean())
    sensor = maker.sensor_of(point.shape, shrink * PITCH_UM, (black_dn, WHITE_DN))
    kernel, path = maker.kernel_of(point, black_dn), folder / "lensless.camkit"
    maker.write_lensless(path, kernel, sensor, proved=False, **settings)
    capture = folder / "hand.tif"
    tifffile.imwrite(capture, np.rint(hand).astype(np.uint16))
    return path, capture


def _shrunk(samples: NDArray[Any], times: int) -> NDArray[np.float64]:
    height, width = samples.shape
    cells = samples.reshape(height // times, times, width // times, times)
    return cells.mean(axis=(1, 3), dtype=np.float64)


def _camkit(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "camkit", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)


def _check_hand(picture: Path, shrink: int) -> None:
    """Check that a bright hand lies on dark ground."""
    levels = cv2.imread(str(picture), cv2.IMREAD_UNCHANGED) / 65535
    assert levels.shape == (1200 // shrink, 1600 // shrink)
    palm = levels[600 // shrink : 700 // shrink, 800 // shrink : 950 // shrink]
    finger = levels[600 // shrink : 630 // shrink, 1150 // shrink : 1350 // shrink]
    gap = levels[550 // shrink : 565 // shrink, 1150 // shrink : 1350 // shrink]
    assert palm.min() > 0.4
    assert finger.mean() > 3 * gap.mean()
    assert np.median(levels) < 0.1


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory, lensless_installed: None) -> Path:  # noqa: F811
    """Return the bundle of a small camera behind a diffuser that is made up."""
    sensor = maker.sensor_of((64, 96), PITCH_UM, (64, 4095))
    folder = tmp_path_factory.mktemp("small")
    made = maker.write_lensless(folder / "small.camkit", speckle(65), sensor, iterations=40)
    return made.path


@pytest.fixture
def shot(small: Path, tmp_path: Path, camkit_command) -> Path:
    file = tmp_path / "shot.tif"
    surround = ("--surround-px", "32")
    outcome = camkit_command("simulate", "procedural:5", "--bundle", small, "-o", file, *surround)
    assert outcome.code == 0, outcome.err
    return file


def test_a_real_capture_shows_a_hand_from_the_ordinary_command_line(tmp_path: Path) -> None:
    bundle, capture = _real(4, tmp_path, **HAND)
    call = ("process", capture, "--bundle", bundle, "--out-dir", tmp_path, "--format", "png")
    outcome = _camkit(*call)
    assert outcome.returncode == 0, outcome.stderr
    assert "the scene explains the capture but for 0." in outcome.stderr
    facts = json.loads((tmp_path / "hand.camkit.json").read_text(encoding="utf-8"))
    assert facts["lensless"]["scene_px"] == [800, 600]
    assert facts["lensless"]["residual"][0] < 0.008
    assert 0 < facts["lensless"]["light_beside_frame"][0] < 0.2
    _check_hand(tmp_path / "hand.png", 4)


@pytest.mark.slow
def test_a_real_capture_of_full_size_stays_within_the_memory_that_was_planned(
    tmp_path: Path,
) -> None:
    bundle, capture = _real(1, tmp_path, **FULL)
    call = ("process", capture, "--bundle", bundle, "--out-dir", tmp_path, "--format", "png")
    planned = json.loads(_camkit("plan", capture, "--bundle", bundle, "--json").stdout)
    outcome = _camkit(*call)
    assert outcome.returncode == 0, outcome.stderr
    facts = json.loads((tmp_path / "hand.camkit.json").read_text(encoding="utf-8"))
    assert facts["peak_rss_mb"] < planned["estimate"]["peak_mb"] < 930
    assert facts["lensless"]["residual"][0] < 0.01
    _check_hand(tmp_path / "hand.png", 1)


def test_it_proves_itself_and_is_planned(small: Path, shot: Path, camkit_command) -> None:
    outcome = camkit_command("check", small, "--json")
    assert outcome.code == 0, outcome.out
    layers = {layer["name"]: layer["status"] for layer in json.loads(outcome.out)["layers"]}
    assert layers["golden"] == "pass"
    outcome = camkit_command("plan", shot, "--bundle", small, "--json")
    planned = json.loads(outcome.out)
    assert planned["plan"]["stages"]["lensless_admm"]["way"] == "lensless"
    assert 240 < planned["estimate"]["peak_mb"] < 300


def test_what_it_simulates_it_makes_a_picture_of(
    shot: Path, small: Path, tmp_path: Path, camkit_command
) -> None:
    outcome = camkit_command("process", shot, "--out-dir", tmp_path, "--bundle", small)
    assert outcome.code == 0, outcome.err
    assert (tmp_path / "shot.exr").is_file()
    facts = json.loads((tmp_path / "shot.camkit.json").read_text(encoding="utf-8"))
    assert facts["lensless"]["residual"][0] < 0.06
    assert facts["iso"] == 100
    assert not any("names no camera" in note for note in facts["warnings"])


def test_rounds_are_counted_and_a_wish_to_stop_is_heard_among_them(shot: Path, small: Path) -> None:
    told: list[tuple[int, int]] = []
    pipeline = camkit.load(small)
    pipeline.process(shot, progress=lambda done, total: told.append((done, total)))
    assert len(told) > 40
    assert told == sorted(told)

    def is_late() -> bool:
        return len(told) > 20

    told.clear()
    with pytest.raises(Cancelled):
        pipeline.process(
            shot, progress=lambda done, total: told.append((done, total)), cancel=is_late
        )
    assert len(told) < 24


def test_bands_and_threads_change_no_bit(shot: Path, small: Path) -> None:
    whole = camkit.load(small, threads=1).process(shot).image
    bands: list[Any] = []
    camkit.load(small, threads=2).stream(shot, lambda _, band: bands.append(band.copy()))
    assert np.array_equal(np.concatenate(bands, axis=1), whole)


def test_too_little_memory_and_other_files_are_refused(
    shot: Path, small: Path, tmp_path: Path, camkit_command
) -> None:
    wide = maker.sensor_of((2400, 3200), PITCH_UM, (64, 4095))
    large = maker.write_lensless(tmp_path / "wide.camkit", speckle(65), wide, proved=False)
    outcome = camkit_command(
        "process", shot, "--bundle", large.path, "--max-mem", "500M", "--out-dir", tmp_path
    )
    assert outcome.code == ExitCode.USAGE, outcome.err
    assert "takes about 1" in outcome.err
    colour = tmp_path / "colour.tif"
    tifffile.imwrite(colour, np.zeros((8, 8, 3), np.uint16), photometric="rgb")
    outcome = camkit_command("process", colour, "--bundle", small, "--out-dir", tmp_path)
    assert "must be a grey TIFF of 16 bits" in outcome.err


def test_a_kernel_that_differs_over_the_field_does_not_join() -> None:
    sensor = maker.sensor_of((32, 32), PITCH_UM, (0, 255))
    optics = FrozenPsfOptics(pixel_pitch_um=PITCH_UM, symmetry="radial")
    parts = Parts(sensor=sensor, optics=optics, networks={})
    light = Plane(channels=("Y",), domain="linear")
    with pytest.raises(JoinError, match="one kernel for the whole frame"):
        LenslessAdmm().join([light], parts)


def test_without_its_package_its_bundle_is_refused_by_name(small: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [sys.executable, "-m", "camkit", "info", str(small)]
    outcome = subprocess.run(
        command, capture_output=True, text=True, cwd=ROOT, check=False, env=environment
    )
    assert outcome.returncode == ExitCode.BUNDLE_REFUSED
    assert "no installed package brings the stage 'lensless_admm'" in outcome.stderr
    assert "the bundle names the package 'lensless-camera'" in outcome.stderr


def test_no_file_of_camkit_knows_it() -> None:
    folders = ("camkit", "runtime", "models_def", "export")
    for file in (path for folder in folders for path in (ROOT / folder).rglob("*.py")):
        assert "lensless" not in file.read_text(encoding="utf-8"), file
