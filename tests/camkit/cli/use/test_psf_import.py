"""`camkit psf import` on the command line, and its page."""

import json
import re

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
    assert "12 places (grid), 3 colours, 11 px at 2.5 um, over 9 x 6 mm" in printed
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


@pytest.mark.parametrize(
    ("options", "note"),
    [
        (["--span-mm", "9x6"], None),
        (["--span-mm", "1.2x0.8"], None),
        (["--span-mm", "9000x6000"], "9000 x 6000 mm, 3600000 x 2400000 px: .* so large; .* in um"),
        (["--span-mm", "0.9x0.6"], "0.9 x 0.6 mm, 360 x 240 px: .* so small; .* or cm"),
        (["--frame-mm", "12000x9000"], "so large"),
        (["--x-mm=-3000,-1000,1000,3000", "--y-mm=-2,0,2"], "so large"),
        (["--heights-mm", ",".join(str(1000 * i) for i in range(12))], "so large"),
    ],
)
def test_a_span_that_no_sensor_has_is_noted_at_import(source, tmp_path, capsys, options, note):
    out = str(tmp_path / "psf.safetensors")
    assert run(["psf", "import", source, "-o", out, "--pitch-um", "2.5", *options]) == 0
    told = capsys.readouterr().err
    assert ("hardly a sensor" not in told) if note is None else re.search(note, told)


def test_one_kernel_is_one_place_of_one_colour(tmp_path, capsys):
    np.save(tmp_path / "one.npy", counts()[0, 0, 0])
    out = str(tmp_path / "psf.safetensors")
    given = [str(tmp_path / "one.npy"), "-o", out, "--pitch-um", "2.5"]
    assert run(["psf", "import", *given]) == 0
    assert "1 place (uniform), 1 colour, 11 px at 2.5 um\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("background", "note"),
    [
        ("keep", "takes it off if it is background; if it is blur that reaches past the border"),
        (
            "border",
            "noise below the subtracted level, .* was cut, and about as much above it stays",
        ),
    ],
)
def test_notes_on_a_background_say_what_else_it_may_be_and_what_stays(
    tmp_path, capsys, background, note
):
    noisy = counts()[0, 0, 0] + 400 + np.random.default_rng(1).normal(0, 100, (11, 11))
    np.save(tmp_path / "one.npy", noisy)
    out = str(tmp_path / "psf.safetensors")
    given = [str(tmp_path / "one.npy"), "-o", out, "--pitch-um", "2.5"]
    assert run(["psf", "import", *given, "--background", background]) == 0
    assert re.search(note, capsys.readouterr().err)
