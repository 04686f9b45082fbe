import json
import re
from pathlib import Path

import pytest

from camkit.cli.exit_code import ExitCode
from tests.zmx_factory import LA1131

PRESCRIPTIONS = Path(__file__).resolve().parents[5] / "models_def" / "prescriptions"


def test_lens_goes_to_zmx_and_back_unchanged(camkit_command, tmp_path: Path) -> None:
    there, back = tmp_path / "duet.zmx", tmp_path / "duet.toml"
    assert camkit_command("lens", "convert", PRESCRIPTIONS / "duet.toml", there).code == 0
    outcome = camkit_command("lens", "convert", there, back, "--json")
    assert json.loads(outcome.out)["surfaces"] == 5
    assert back.read_text() == (PRESCRIPTIONS / "duet.toml").read_text()


def test_a_lens_is_scaled_to_a_focal_length_and_then_stopped(
    camkit_command, tmp_path: Path
) -> None:
    out = tmp_path / "long.zmx"
    asked = ("--efl-mm", 85, "--f-number", 5.6)
    assert camkit_command("lens", "convert", PRESCRIPTIONS / "duet.toml", out, *asked).code == 0
    shown = json.loads(camkit_command("lens", "show", out, "--json").out)
    assert shown["efl_mm"] == pytest.approx(85, rel=1e-9)
    assert shown["f_number"] == pytest.approx(5.6, rel=1e-9)
    wrong = camkit_command("lens", "convert", out, tmp_path / "x.toml", "--efl-mm", -85)
    assert wrong.code == ExitCode.USAGE
    assert "focal length" in wrong.err
    assert not (tmp_path / "x.toml").exists()


def test_rims_that_cut_the_opened_beam_are_said(camkit_command, tmp_path: Path) -> None:
    source, out = PRESCRIPTIONS / "cooke-triplet-f5.toml", tmp_path / "x.toml"
    closed = camkit_command("lens", "convert", source, out, "--f-number", 8, "--json")
    assert json.loads(closed.out)["notes"] == []
    narrow = tmp_path / "narrow.toml"
    text = out.read_text().replace("semi_diameter_mm = ", "semi_diameter_mm = 4.0 # ", 1)
    narrow.write_text(text)
    opened = camkit_command("lens", "convert", narrow, tmp_path / "y.toml", "--f-number", 4)
    assert "rims are not opened for the new F-number: they cut" in opened.err
    scaled = ("--f-number", 4, "--efl-mm", 60, "--overwrite")
    both = camkit_command("lens", "convert", narrow, tmp_path / "y.toml", *scaled)
    assert "rims are scaled with the lens, not opened" in both.err


def test_what_is_left_out_is_said_on_stderr(camkit_command, tmp_path: Path) -> None:
    source = tmp_path / "vendor.zmx"
    source.write_text(LA1131.replace("VCYN 0 0", "VCYN 0 0.2"), encoding="latin-1")
    outcome = camkit_command("lens", "convert", source, tmp_path / "x.toml")
    assert outcome.code == 0
    assert "vendor.zmx: line 12: vignetting factors VCYN left out" in outcome.err


def test_own_glass_is_taken_from_a_catalogue_and_into_the_toml(
    camkit_command, tmp_path: Path
) -> None:
    source, glass, out = tmp_path / "my.zmx", tmp_path / "my.agf", tmp_path / "my.toml"
    source.write_text(LA1131.replace("GLAS N-BK7", "GLAS FOO"), encoding="latin-1")
    glass.write_text("NM FOO 2 0 1.6 50\nCD 1.4 0.01\nLD 0.3 2\n")
    failed = camkit_command("lens", "convert", source, out)
    assert failed.code == ExitCode.USAGE
    assert "a file in .agf, with --glass" in failed.err
    assert camkit_command("lens", "convert", source, out, "--glass", glass).code == 0
    glass.unlink()
    assert camkit_command("lens", "convert", out, tmp_path / "again.toml").code == 0
    assert (tmp_path / "again.toml").read_text() == out.read_text()


@pytest.mark.parametrize("name", ["x.toml", "x.seq"])
def test_existing_and_unknown_files_are_refused(camkit_command, tmp_path: Path, name: str) -> None:
    out = tmp_path / name
    if name == "x.toml":
        out.write_text("kept")
    outcome = camkit_command("lens", "convert", PRESCRIPTIONS / "duet.toml", out)
    assert outcome.code != 0
    assert "--overwrite" in outcome.err or "lens file ends in" in outcome.err
    assert not out.exists() or out.read_text() == "kept"


def test_a_lens_goes_to_the_json_of_optiland_and_back(camkit_command, tmp_path: Path) -> None:
    there, back = tmp_path / "duet.json", tmp_path / "duet.toml"
    assert camkit_command("lens", "convert", "duet", "-o", there).code == 0
    assert len(json.loads(there.read_text())["surface_group"]["surfaces"]) == 7
    assert camkit_command("lens", "convert", there, "--out", back).code == 0
    original = (PRESCRIPTIONS / "duet.toml").read_text()
    surfaces = original.partition("[[surface]]")[2]
    assert back.read_text().partition("[[surface]]")[2] == surfaces


def test_the_sag_of_every_surface_goes_to_a_table(camkit_command, tmp_path: Path) -> None:
    """A sphere of radius R: R - sqrt(R^2 - r^2), and the slope r / sqrt(R^2 - r^2)."""
    source, out = tmp_path / "vendor.zmx", tmp_path / "sag.csv"
    source.write_text(LA1131, encoding="latin-1")
    outcome = camkit_command("lens", "convert", source, out)
    assert outcome.code == 0
    assert "no rim: the table ends where the paraxial beam does, surfaces 1 (" in outcome.err
    head, *rows = out.read_text().splitlines()
    assert head == "surface,radius_mm,height_um,slope"
    table = [tuple(map(float, row.split(","))) for row in rows]
    assert {row[0] for row in table} == {0, 1}
    for number, radius, height, slope in table:
        root = (25.75**2 - radius**2) ** 0.5
        assert height == pytest.approx(1000 * (25.75 - root) if number == 0 else 0, abs=1e-3)
        assert slope == pytest.approx(radius / root if number == 0 else 0, abs=1e-6)
    assert max(row[1] for row in table) == 12.7


def test_tables_say_what_is_no_height(camkit_command, tmp_path: Path) -> None:
    source, out = tmp_path / "my.toml", tmp_path / "sag.csv"
    face = "[[surface]]\nradius_mm = inf\nthickness_mm = 4.0\nsemi_diameter_mm = 6.0\n"
    phase = "phase_radius_mm = 6.0\nphase_radial_rad = [-40.0]\n"
    tilt = 'glass = "N-BK7-Schott"\nelement_tilt_deg = [5.0, 0.0]\n'
    source.write_text(f'name = "x"\nstop = 0\nf_number = 8.0\n{face}{phase}{face}{tilt}{face}')
    told = ("the phase of surface 0 is no height", "tilt and decentre of surface 1 stay behind")
    whole = camkit_command("lens", "convert", source, out)
    assert whole.code == 0, whole.err
    assert all(text in whole.err for text in told)
    for number, text in enumerate(told):
        alone = camkit_command(
            "lens", "sag", source, "--surface", number, "-o", tmp_path / f"{number}.csv"
        )
        assert [other in alone.err for other in told] == [other == text for other in told]


def test_the_unit_of_a_file_and_the_focal_length_are_said(camkit_command, tmp_path: Path) -> None:
    """A factor of 1000 is seen, and a file that cannot be read is named."""
    zmx, out = tmp_path / "metres.zmx", tmp_path / "out.toml"
    in_mm = camkit_command("lens", "convert", PRESCRIPTIONS / "duet.toml", zmx, "--json")
    efl_mm = json.loads(in_mm.out)["efl_mm"]
    text = zmx.read_text(encoding="utf-16")
    assert "UNIT MM" in text
    zmx.write_text(text.replace("UNIT MM", "UNIT METER"), encoding="utf-16")
    outcome = camkit_command("lens", "convert", zmx, out)
    assert f"surfaces, EFL {1000 * efl_mm:.4g} mm" in outcome.out
    assert "metres.zmx: lengths of the file are in METER: 1000 mm each" in outcome.err
    zmx.write_text(re.sub("TYPE [A-Z0-9_]+", "TYPE DGRATING", text), encoding="utf-16")
    refused = camkit_command("lens", "convert", zmx, out, "--overwrite")
    assert "camkit: metres.zmx: line " in refused.err


def test_one_file_to_write_is_named(camkit_command, tmp_path: Path) -> None:
    none = camkit_command("lens", "convert", "duet")
    both = camkit_command("lens", "convert", "duet", tmp_path / "a.zmx", "-o", tmp_path / "b.zmx")
    for outcome in (none, both):
        assert outcome.code == ExitCode.USAGE
        assert "name one file to write: OUT or --out" in outcome.err


def test_a_catalogue_is_chosen_for_a_name_that_several_have(camkit_command, tmp_path: Path) -> None:
    source, out = tmp_path / "my.toml", tmp_path / "out.toml"
    text = (PRESCRIPTIONS / "duet.toml").read_text()
    source.write_text(re.sub(r'glass = "(?!air)[^"]*"', 'glass = "F2"', text))
    failed = camkit_command("lens", "convert", source, out)
    assert "F2-Schott or F2-Hikari" in failed.err
    assert "--catalogue" in failed.err
    chosen = ("--catalogue", "hikari,schott")
    assert camkit_command("lens", "convert", source, out, *chosen).code == 0
    assert "F2-Hikari" in out.read_text()
    wrong = camkit_command("lens", "convert", source, tmp_path / "x.zmx", "--catalogue", "shcott")
    assert wrong.code == ExitCode.USAGE
    assert "--catalogue names some of schott" in wrong.err
