"""`camkit freeze --unit`: a body is photographed, measured and used; wrong words are refused."""

import json
import tomllib
from pathlib import Path

import pytest

from camkit.bundle.reader import Bundle
from camkit.cli.exit_code import ExitCode
from camkit.runtime.unit import format_unit, lens_hash, read_unit
from tests.focus_bundle import LENS, write_focus_bundle


@pytest.fixture
def bundle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bundle:
    monkeypatch.chdir(tmp_path)
    return write_focus_bundle(tmp_path)


def body(focus_um: float) -> None:
    """Write a body whose focus is known."""
    text = format_unit("true", {"lens_sha256": lens_hash(LENS)}, {"focus_um": focus_um})
    Path("true.toml").write_text(text)


def test_a_body_is_photographed_measured_and_used(bundle: Bundle, camkit_command) -> None:
    body(18.0)
    for seed in (1, 2):
        outcome = camkit_command(
            *("simulate", f"squares:{seed}", "--bundle", "focused.camkit", "-o", f"{seed}.dng"),
            *("--unit", "true.toml", "--seed", seed),
        )
        assert outcome.code == 0, outcome.err
    psf = json.loads(camkit_command("info", "focused.camkit", "--json").out)["psf"]
    assert psf["focus_um"] == [-40.0, 40.0]
    measure = ("freeze", "focused.camkit", "--unit", "1.dng", "2.dng", "-o", "found/unit.toml")
    outcome = camkit_command(*measure, "--json")
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    assert told["focus_um"] == pytest.approx(18.0, abs=0.7)
    assert (told["captures"], told["out"]) == (2, "found/unit.toml")
    unit = read_unit(Path("found/unit.toml"))
    assert (unit.name, unit.focus_um) == ("unit", told["focus_um"])
    measured = tomllib.loads(Path("found/unit.toml").read_text())["measured"]
    assert measured["standard_error_um"] == told["standard_error_um"]
    assert "exists; say --overwrite" in camkit_command(*measure).err
    process = ("process", "1.dng", "--bundle", "focused.camkit", "--unit", "found/unit.toml")
    assert camkit_command(*process).code == 0
    sidecar = json.loads(Path("1.camkit.json").read_text())
    assert sidecar["plan"]["focus_um"] == told["focus_um"]
    assert sidecar["options"]["unit"]["lens_sha256"] == lens_hash(LENS)


def test_a_camera_in_focus_and_one_without_kernels_are_refused(
    bundle: Bundle, camkit_command, tmp_path: Path
) -> None:
    camkit_command("simulate", "squares:1", "--bundle", "focused.camkit", "-o", "1.dng")
    outcome = camkit_command("freeze", "focused.camkit", "1.dng", "--unit", "-o", "u.toml")
    assert "from the nominal one: leave the unit out" in outcome.err
    write_focus_bundle(tmp_path, "plain", moved=False)
    outcome = camkit_command("freeze", "plain.camkit", "1.dng", "--unit", "-o", "u.toml")
    assert "knows the nominal focus alone: freeze it with --focus-um" in outcome.err
    body(5.0)
    outcome = camkit_command("process", "1.dng", "--bundle", "plain.camkit", "--unit", "true.toml")
    assert outcome.code == ExitCode.USAGE
    assert "knows the nominal focus alone" in outcome.err
    assert not Path("u.toml").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--unit", "-o", "u.toml"), "--unit needs captures of a target"),
        (("--unit", "1.dng", "-o", "u.safetensors"), "a unit is TOML"),
        (("1.dng", "-o", "u.toml"), "captures are for --unit"),
        (("1.dng", "--unit", "-o", "u.toml", "--report", "r.json"), "the unit alone; leave"),
        (("1.dng", "--unit", "-o", "u.toml", "--focus-um", "9"), "holds its kernels already"),
        (("1.dng", "--unit", "-o", "u.toml", "--depths-mm", "1,2"), "lies at one distance"),
    ],
)
def test_words_that_do_not_fit_are_refused(
    bundle: Bundle, camkit_command, words: tuple[str, ...], message: str
) -> None:
    outcome = camkit_command("freeze", "focused.camkit", *words)
    assert outcome.code == ExitCode.USAGE
    assert message in outcome.err
    assert len(outcome.err.strip().splitlines()) == 1


@pytest.mark.parametrize("text", ["-3", "0", "much", "inf", "nan"])
def test_a_reach_is_a_number_or_auto(camkit_command, tmp_path: Path, text: str) -> None:
    out = tmp_path / "psf.safetensors"
    outcome = camkit_command("freeze", "duet", "-o", out, f"--focus-um={text}")
    assert outcome.code == ExitCode.USAGE
    assert "--focus-um takes a number > 0 or auto" in outcome.err


def test_only_a_lens_is_traced_with_its_sensor_moved(camkit_command, tmp_path: Path) -> None:
    words = ("freeze", "streak-4", "-o", tmp_path / "psf.safetensors", "--focus-um")
    assert "only of a lens it is known" in camkit_command(*words, "auto").err
    assert "frozen at its nominal focus" in camkit_command(*words, "20").err
    unit = ("freeze", "streak-4", tmp_path / "a.dng", "--unit", "-o", tmp_path / "u.toml")
    assert "measured with a lens or a bundle; streak-4 is neither" in camkit_command(*unit).err
