"""`--configuration` of the commands that read a lens."""

import json
from pathlib import Path

import pytest

from camkit.caller import option_text
from camkit.cli.exit_code import ExitCode
from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.lens_file import read_configured_lens, read_lens
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.optics_file import read_optics

PRESCRIPTIONS = Path(__file__).resolve().parents[5] / "models_def" / "prescriptions"
STATES = """
[[configuration]]
name = "far"
field_angles_deg = [0.0, 8.0]

[[configuration]]
name = "near"
thickness_mm = { 2 = 9.0 }
object_distance_mm = 2000.0
"""


@pytest.fixture(name="lens_file")
def fixture_lens_file(tmp_path: Path) -> Path:
    path = tmp_path / "focusing.toml"
    path.write_text((PRESCRIPTIONS / "cooke-triplet.toml").read_text() + STATES)
    return path


def test_the_usual_state_is_shown_beside_a_table_of_all(camkit_command, lens_file: Path) -> None:
    shown = json.loads(camkit_command("lens", "show", lens_file, "--json").out)
    assert shown["name"].endswith("(configuration far)")
    assert [field["field_angle_deg"] for field in shown["fields"]][-1] == 8.0
    far, near = shown["configurations"]
    assert (far["name"], far["is_default"], far["object_distance_mm"]) == ("far", True, None)
    assert (near["name"], near["is_default"], near["object_distance_mm"]) == ("near", False, 2000)
    assert far["efl_mm"] == shown["efl_mm"]
    assert near["efl_mm"] != far["efl_mm"]
    assert near["axis_spot_rms_mm"] > far["axis_spot_rms_mm"] > 0
    mine = next(r for r in shown["convergence"] if r["pupil_sampling"] == shown["pupil_sampling"])
    spots = far["axis_spot_rms_mm"], far["widest_spot_rms_mm"]
    assert spots == pytest.approx((mine["spot_rms_mm"][0], mine["spot_rms_mm"][-1]))


def test_a_state_is_shown_by_number_and_its_page_lists_all(
    camkit_command, lens_file: Path, tmp_path: Path
) -> None:
    out = camkit_command("lens", "show", lens_file, "--configuration", 2, "-o", tmp_path, "--json")
    near = json.loads(out.out)
    assert near["efl_mm"] == near["configurations"][1]["efl_mm"]
    page = (tmp_path / "focusing.html").read_text()
    assert "<td>far (default)</td>" in page
    assert "<td>near</td>" in page
    wrong = camkit_command("lens", "show", lens_file, "--configuration", "tele", "--json")
    assert wrong.code == ExitCode.USAGE
    assert "--configuration is one of far, near, or a number 1..2; got 'tele'" in wrong.err


def test_convert_keeps_all_states_or_writes_one(
    camkit_command, lens_file: Path, tmp_path: Path
) -> None:
    zmx, back = tmp_path / "all.zmx", tmp_path / "back.toml"
    written = camkit_command("lens", "convert", lens_file, zmx, "--json")
    assert json.loads(written.out)["configurations"] == ["far", "near"]
    assert "numbered in OUT, their names stay behind: far, near" in written.err
    assert camkit_command("lens", "convert", zmx, back, "--efl-mm", 100).code == 0
    lens = read_configured_lens(back)[0]
    assert [state.name for state in lens.configurations] == ["1", "2"]
    shown = json.loads(camkit_command("lens", "show", back, "--json").out)
    assert shown["efl_mm"] == pytest.approx(100)
    one = tmp_path / "one.toml"
    assert camkit_command("lens", "convert", lens_file, one, "--configuration", "near").code == 0
    near = read_lens(one)
    assert (near.configurations, near.state, near.object_distance_mm) == ((), "near", 2000.0)
    noted = camkit_command("lens", "convert", lens_file, tmp_path / "one.json")
    assert "2 configurations (far, near): far is taken; choose by --configuration" in noted.err


def test_frozen_optics_record_their_state(lens_file: Path) -> None:
    optics = read_optics(lens_file, configuration="near")
    assert isinstance(optics, LensOptics)
    assert optics.facts["configuration"] == "near"
    assert optics.depths_mm == (2000.0,)
    assert "configuration" not in read_optics(Path("cooke-triplet")).facts


@pytest.mark.parametrize(
    "words", [{"configuration": 1}, {"catalogue": "schott"}, {"glass": (Path("my.agf"),)}]
)
def test_optics_without_glass_refuse_what_is_of_a_lens(words) -> None:
    message = f"is no lens; leave {option_text(next(iter(words)))} out"
    with pytest.raises(ContractError, match=message):
        read_optics(Path("no.safetensors"), **words)


def test_a_recipe_is_of_one_state(camkit_command, lens_file: Path, tmp_path: Path) -> None:
    words = ("--sensor", "1600x1200@5um", "--configuration", "near", "--json")
    outcome = camkit_command("recipe", lens_file, "-o", tmp_path / "near.toml", *words)
    assert outcome.code == 0, outcome.err
    lens = read_lens(tmp_path / "near-lens.toml")
    assert (lens.state, lens.surfaces[2].thickness_mm) == ("near", 9.0)


def test_tolerances_and_optimization_take_one_state(
    camkit_command, lens_file: Path, tmp_path: Path
) -> None:
    out = tmp_path / "better.toml"
    options = ("--vary", "curvature", "--starts", 1, "--steps", 1, "--rays", 6)
    asked = ("--configuration", "near", *options, "-o", out)
    assert camkit_command("lens", "optimize", lens_file, *asked).code == 0
    assert read_lens(out).object_distance_mm == 2000.0
    sag = ("--surface", 0, "-o", tmp_path / "sag.csv", "--configuration", "tele")
    assert "one of far, near" in camkit_command("lens", "sag", lens_file, *sag).err
