"""`camkit psf import` on the command line, and its page."""

import json

import numpy as np
import pytest

from camkit.cli.app import run
from tests.psf_files import PITCH_UM, SPAN, counts, write_all


@pytest.fixture
def source(tmp_path):
    np.save(tmp_path / "psf.npy", counts())
    return str(tmp_path / "psf.npy")


def test_what_was_normalised_is_printed_and_drawn(source, tmp_path, capsys):
    out, page = str(tmp_path / "psf.safetensors"), tmp_path / "psf.html"
    given = ["--pitch-um", str(PITCH_UM), "--span-mm", SPAN, "--page", str(page)]
    assert run(["psf", "import", source, "-o", out, *given]) == 0
    printed = capsys.readouterr().out
    assert "12 places (grid), 3 colours, 11 px at 2.5 um" in printed
    for words in (
        "now 1",
        "negative 0.00%",
        "middle at row 5, column 5",
        "uncertainty (estimated)",
    ):
        assert words in printed
    html = page.read_text(encoding="utf-8")
    for words in (
        "Where they lie",
        "Which way they point",
        "What was normalised",
        "data:image/png",
    ):
        assert words in html


def test_json_holds_what_was_read(source, tmp_path, capsys):
    out = str(tmp_path / "psf.safetensors")
    given = ["--pitch-um", "2.5", "--to-pitch-um", "5", "--frame-mm", "12x9", "--json"]
    assert run(["psf", "import", source, "-o", out, *given]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["grid_x_mm"] == [-4.5, -1.5, 1.5, 4.5]
    assert (record["pixel_pitch_um"], record["side_px"], record["files"]) == (5.0, 7, 1)
    assert record["normalised"]["resampled_by"] == 0.5
    assert record["uncertainty"]["estimated"] is True


def test_every_form_of_zemax_names_is_one_pattern(tmp_path, capsys):
    pattern = write_all(tmp_path, counts())["zemax"]
    out = str(tmp_path / "psf.safetensors")
    assert run(["psf", "import", pattern, "-o", out, "--span-mm", SPAN]) == 0
    assert "12 places (grid), 3 colours" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ([], "--span-mm WIDTHxHEIGHT"),
        (["--span-mm", SPAN], "add --pitch-um"),
        (["--centre", "left"], "--centre takes middle, peak, centroid"),
        (["--axes", "h,w"], "--axes names 2"),
        (["--grid", "3"], "--grid takes ROWSxCOLUMNS"),
    ],
)
def test_a_fault_is_one_line_that_names_its_option(source, tmp_path, capsys, more, words):
    out = tmp_path / "psf.safetensors"
    assert run(["psf", "import", source, "-o", str(out), *more]) != 0
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert words in lines[0]
    assert not out.exists()


def test_one_command_reads_kernels_and_another_names_it(source, tmp_path, capsys):
    assert run(["freeze", source, "-o", str(tmp_path / "psf.safetensors")]) != 0
    assert "`camkit psf import`" in capsys.readouterr().err
