import json
from pathlib import Path

import pytest

from camkit.cli.exit_code import ExitCode

PRESCRIPTIONS = Path(__file__).resolve().parents[5] / "models_def" / "prescriptions"
DUET = PRESCRIPTIONS / "duet.toml"
QUICK = ("--samples", "2", "--rays", "32")


@pytest.fixture
def errors(tmp_path: Path) -> Path:
    path = tmp_path / "errors.toml"
    path.write_text("[tolerance]\nelement_decentre_mm = 0.05\n")
    return path


def test_yield_is_printed_charted_and_written(camkit_command, tmp_path: Path, errors: Path) -> None:
    out = tmp_path / "out"
    command = ("lens", "tolerance", DUET, "--errors", errors, "-o", out, *QUICK)
    outcome = camkit_command(*command)
    assert outcome.code == 0, outcome.err
    assert outcome.err == ""
    assert "2 Monte-Carlo samples" in outcome.out
    assert "element_decentre" in outcome.out
    names = {path.name for path in out.iterdir()}
    assert names == {f"duet-tolerance.{kind}" for kind in ("png", "svg", "json")}
    assert json.loads((out / "duet-tolerance.json").read_text())["samples"] == 2
    again = camkit_command(*command)
    assert again.code == ExitCode.USAGE
    assert "--overwrite" in again.err


def test_a_zmx_file_is_read_too(camkit_command, tmp_path: Path, errors: Path) -> None:
    zmx = tmp_path / "duet.zmx"
    assert camkit_command("lens", "convert", DUET, zmx).code == 0
    outcome = camkit_command("lens", "tolerance", zmx, "--errors", errors, "--json", *QUICK)
    assert outcome.code == 0, outcome.err
    found = json.loads(outcome.out)
    assert [row["class"] for row in found["sensitivity"]] == ["element_decentre"]


def test_the_table_may_stand_in_the_lens_file(camkit_command, tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(DUET.read_text() + '\n[tolerance]\nfocus_mm = 0.1\ncompensator = "none"\n')
    outcome = camkit_command("lens", "tolerance", mine, "--json", *QUICK)
    assert outcome.code == 0, outcome.err
    found = json.loads(outcome.out)
    assert found["compensator"] == "none"
    assert [row["half_width"] for row in found["sensitivity"]] == ["0.1 mm"]


def test_wrong_tables_and_folders_are_refused(camkit_command, tmp_path: Path) -> None:
    bare, typo = tmp_path / "bare.toml", tmp_path / "typo.toml"
    bare.write_text("radius_percent = 1\n")
    typo.write_text("[tolerance]\nradius = 1\n")
    for arguments, word in (
        (("--errors", bare), "[tolerance]"),
        (("--errors", typo), "radius_percent"),
        (("--data", tmp_path / "none"), "not there"),
    ):
        outcome = camkit_command("lens", "tolerance", DUET, "--json", *arguments)
        assert outcome.code == ExitCode.USAGE
        assert word in outcome.err
