"""`camkit calibrate blur` on the command line and from Python, and its page."""

import json
import shutil

import numpy as np
import pytest
import tifffile

import camkit
from camkit.bundle.psf_file import read_measurement
from camkit.cli.app import run
from tests.camkit.calibration.blur_factory import photograph

SHOWN = ["--pixel-pitch-um", "5", "--reach-px", "8"]


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Two photographs as linear 16-bit TIFF."""
    folder = tmp_path_factory.mktemp("photographs")
    files = []
    for seed in range(2):
        samples = photograph(seed, (240, 320), cfa=None).samples
        files.append(folder / f"{seed}.tif")
        tifffile.imwrite(files[-1], np.moveaxis(samples, 0, -1), photometric="rgb")
    return [str(file) for file in files]


def test_photographs_become_a_psf_and_a_page(pictures, tmp_path, capsys):
    out, page = tmp_path / "lens.safetensors", tmp_path / "lens.html"
    words = ["calibrate", "blur", *pictures, "-o", str(out), "--page", str(page), *SHOWN, "--json"]
    assert run(words) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["edges"] >= 16
    assert record["photos"]["0.tif"]["edges"] > 0
    assert len(record["heights"][0]["colours"]) == 3
    assert record["held_out"]["percent"] < 3
    psf, uncertainty = read_measurement(out)
    assert uncertainty is not None
    assert psf.pixel_pitch_um == 5.0
    assert "What is not determined" in page.read_text(encoding="utf-8")
    assert run(words) != 0  # the file is there
    lines = ["calibrate", "blur", *pictures, "-o", str(out), *SHOWN, "--overwrite"]
    assert run(lines) == 0
    printed = capsys.readouterr()
    assert "held-out edges" in printed.out
    assert "is not determined" in printed.err


def test_halves_of_one_exposure_count_once(pictures, tmp_path):
    files = []
    for side in "lr":
        files.append(tmp_path / f"shot_{side}.tif")
        shutil.copy(pictures[0], files[-1])
    result = camkit.calibrate.blur(files, halves="_l,_r", pixel_pitch_um=5.0, reach_px=8.0)
    assert list(result.photos) == ["shot_l.tif"]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--pixel-pitch-um", "5", "--reach-px", "2"], "--reach-px is 6 to 64"),
        (["--reach-px", "8"], "add --pixel-pitch-um"),
        ([*SHOWN, "--tone", "nothing.toml"], "--tone takes srgb, linear"),
    ],
)
def test_refusals_name_what_to_do(more, words, pictures, tmp_path, capsys):
    out = tmp_path / "lens.safetensors"
    assert run(["calibrate", "blur", *pictures, "-o", str(out), *more]) != 0
    assert words in capsys.readouterr().err
    assert not out.exists()
