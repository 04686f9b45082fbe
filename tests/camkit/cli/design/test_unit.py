"""`camkit freeze --unit`: a body is photographed, measured and used; wrong words are refused."""

import json
import tomllib
from functools import partial
from pathlib import Path

import pytest

from camkit.bundle.reader import PRESCRIPTION, Bundle, find_bundle, open_bundle
from camkit.calibrate import body_focus
from camkit.cli.exit_code import ExitCode
from camkit.models_def.optics import frozen, optics_file
from camkit.models_def.optics.frozen import FreezeGrid, freeze
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.runtime.twin.simulate import SimulationOptions, simulate, write_capture
from camkit.runtime.unit import format_unit, lens_hash, read_unit
from camkit.scenes.squares import squares_scene
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
    assert "exists; add --overwrite" in camkit_command(*measure).err
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
    assert "from the nominal one: omit --unit" in outcome.err
    write_focus_bundle(tmp_path, "plain", moved=False)
    outcome = camkit_command("freeze", "plain.camkit", "1.dng", "--unit", "-o", "u.toml")
    assert "has the nominal focus alone: freeze it with --focus-um" in outcome.err
    body(5.0)
    outcome = camkit_command("process", "1.dng", "--bundle", "plain.camkit", "--unit", "true.toml")
    assert outcome.code == ExitCode.USAGE
    assert "has the nominal focus alone" in outcome.err
    assert not Path("u.toml").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--unit", "-o", "u.toml"), "a camera body needs captures of a target"),
        (("--unit", "1.dng", "-o", "u.safetensors"), "a camera body is TOML"),
        (("1.dng", "-o", "u.toml"), "captures are for --unit"),
        (
            ("1.dng", "--unit", "-o", "u.toml", "--report", "r.json"),
            "freezes nothing; leave --report out",
        ),
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
    assert "auto needs a lens" in camkit_command(*words, "auto").err
    assert "only a lens is traced with its sensor moved" in camkit_command(*words, "20").err
    unit = ("freeze", "streak-4", tmp_path / "a.dng", "--unit", "-o", tmp_path / "u.toml")
    assert "measured with a lens or a bundle; streak-4 is neither" in camkit_command(*unit).err


def test_a_lens_is_traced_to_measure_with(
    camkit_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The body is the lens with its sensor moved, photographed through kernels of its own."""
    few_rays = partial(LensOptics, rays=300)
    monkeypatch.setattr(optics_file, "LensOptics", few_rays)
    monkeypatch.setattr(frozen, "FINE_WAVELENGTHS", 7)
    monkeypatch.setattr(body_focus, "STEPS", (-1.0, 1.0))
    bundle = open_bundle(find_bundle("duet"))
    lens = few_rays(lens=find_lens("duet")).refocused(35.0)
    sensor = bundle.manifest.sensor
    assert sensor.type == "bayer"
    psf = freeze(lens, sensor, FreezeGrid(fields=5, wavelengths=5, least_energy=0.9)).psf
    names = []
    for number, origin_px in enumerate(((2700, 1700), (600, 400))):
        options = SimulationOptions(seed=number, origin_px=origin_px)
        taken = simulate(squares_scene(number, 640, 640), sensor, psf, options)
        names.append(tmp_path / f"{number}.dng")
        write_capture(names[-1], taken, sensor, "duet")
    out = tmp_path / "unit.toml"
    outcome = camkit_command("freeze", "duet", "--unit", *names, "-o", out, "--focus-um", "60")
    assert outcome.code == 0, outcome.err
    unit = read_unit(out)
    assert unit.focus_um == pytest.approx(35, abs=4)
    assert unit.lens_sha256 == lens_hash(bundle.member(PRESCRIPTION))
