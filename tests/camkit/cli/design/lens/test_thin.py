"""`camkit lens thin`, `lens peak` and `lens sag` from files to reports."""

import json
from pathlib import Path

import pytest

from camkit.cli.exit_code import ExitCode
from camkit.models_def.optics.lens_file.lens_file import read_lens

RECIPES = Path(__file__).resolve().parents[5] / "models_def" / "recipes"


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("thin") / "quick.toml"
    text = (
        (RECIPES / "thin_plate_lens.toml").read_text().replace("directions = 7", "directions = 2")
    )
    text = text.replace("weights = [1.0, 1.0, 1.0, 1.0, 1.0, 1.5, 2.0]", "")
    path.write_text(text + "\n[solver]\nsteps = 10\nrays = 20\n")
    return path


def test_a_plate_is_solved_written_and_reported(camkit_command, tmp_path: Path, quick) -> None:
    out = tmp_path / "plates" / "p.toml"
    outcome = camkit_command("lens", "thin", quick, "-o", out, "--json")
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    assert told["out"] == str(out)
    assert [d["field_angle_deg"] for d in told["virtual_apertures"]] == [0.0, 28.6]
    assert [f["field_angle_deg"] for f in told["fields"]] == [0.0, 14.3, 28.6]
    assert told["waves"] == []
    lens = read_lens(out)
    assert [s.grooves is None for s in lens.surfaces] == [True, False, False]
    again = camkit_command("lens", "thin", quick, "-o", out)
    assert again.code == ExitCode.USAGE
    assert "--overwrite" in again.err
    assert camkit_command("lens", "thin", quick, "-o", out, "--overwrite").code == 0
    tool = ("--tool-radius-um", 16)
    assert camkit_command("lens", "thin", quick, "-o", out, "--overwrite", *tool).code == 0
    assert "tool_radius_um = 16.0" in out.read_text()
    blunt = camkit_command("lens", "peak", out, "--tool-radius-um", 900)
    assert blunt.code == ExitCode.INPUT_FAILED
    assert "narrower than the tool" in blunt.err
    peaks = camkit_command("lens", "peak", out)
    assert peaks.code == 0, peaks.err
    assert "within 10 px, least of all fields" in peaks.out
    assert "surface 2:" in peaks.out


def test_a_groove_narrower_than_the_tool_is_one_line(camkit_command, tmp_path: Path, quick) -> None:
    blunt, out = tmp_path / "blunt.toml", tmp_path / "p.toml"
    blunt.write_text(quick.read_text().replace("terms = 6", "terms = 6\ntool_radius_um = 500.0"))
    outcome = camkit_command("lens", "thin", blunt, "-o", out)
    assert outcome.code == ExitCode.INPUT_FAILED
    assert "narrower than the tool" in outcome.err
    assert outcome.err.count("\n") == 1
    assert not out.exists()


def test_what_cannot_be_is_refused_in_one_line(camkit_command, tmp_path: Path, quick) -> None:
    for arguments, words in (
        (("thin", quick, "-o", tmp_path / "p.zmx"), "ends in .toml"),
        (("thin", tmp_path / "none.toml", "-o", tmp_path / "p.toml"), "cannot read recipe"),
        (("sag", "thin-plate", "--surface", 3, "-o", tmp_path / "s.csv"), "--surface must be 0..2"),
    ):
        outcome = camkit_command("lens", *arguments)
        assert outcome.code != 0
        assert words in outcome.err, outcome.err
        assert outcome.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_profile_goes_to_the_workshop(camkit_command, tmp_path: Path) -> None:
    out = tmp_path / "shop" / "s.csv"
    command = ("lens", "sag", "thin-plate", "--surface", 2, "-o", out)
    outcome = camkit_command(*command, "--json")
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    assert told["walls"] == 40
    assert told["rows"] == len(out.read_text().splitlines()) - 1
    assert told["height_um"] == pytest.approx([-111.655, 0.0], abs=0.01)
    assert camkit_command(*command).code == ExitCode.USAGE
    assert "40 walls" in camkit_command(*command, "--overwrite").out


def test_a_page_lists_the_grooves(camkit_command, tmp_path: Path) -> None:
    plate = "thin-plate-stop"
    outcome = camkit_command("lens", "show", plate, "-o", tmp_path, "--json", "--pupil", "stop")
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    assert [found["walls"] for found in told["grooves"]] == [7, 40]
    assert told["fields"][-1]["rays"]["second_hit"] > 0
    assert "with walls" in (tmp_path / f"{plate}.html").read_text()


def test_copies_of_a_plate_are_drawn(camkit_command, tmp_path: Path) -> None:
    errors = tmp_path / "e.toml"
    errors.write_text("[tolerance]\nsurface_decentre_mm = 0.02\n")
    command = ("lens", "tolerance", "thin-plate-stop", "--errors", errors, "--json")
    outcome = camkit_command(*command, "--samples", 2, "--rays", 64)
    assert outcome.code == 0, outcome.err
