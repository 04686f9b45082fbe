"""`camkit plate design` from a recipe to a plate, a checkpoint and a log; resume."""

import json
from pathlib import Path

import pytest

from camkit.cli.app import run
from camkit.cli.exit_code import ExitCode
from camkit.models_def.optics.diffraction.plate import read_plate
from camkit.models_def.training.first_weights import read_first_weights
from tests.models_def.design.plate.joint_recipe import READER, write_camera

RECIPE = """
name = "small"
cells = 96

[bench]
diameter_mm = 2.0
focal_length_mm = 25.0
focus_mm = 2000.0

[map]
kind = "rank"
rank = 1
offset = 1.0
start = 0.1

[goal]
near_px = 4.0
far_px = 20.0

[pixels]
pitch_um = 6.0
side_px = 41
wavelengths_um = [0.55]
samples = 2

[etching]
range_um = 1.125

[schedule]
steps = 4
rate = 0.05
log_steps = 2
"""


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "small_plate.toml"
    path.write_text(RECIPE, encoding="utf-8")
    return path


def test_a_design_leaves_a_plate_a_checkpoint_and_a_log(
    recipe: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = recipe.parent / "runs" / "small.toml"
    words = ["plate", "design", str(recipe), "-o", str(out)]
    assert run([*words, "--json"]) == ExitCode.DONE
    told = capsys.readouterr()
    report = json.loads(told.out)
    assert (report["steps"], report["of_steps"]) == (4, 4)
    assert report["best_loss"] <= report["begin_loss"]
    assert [line.split(":")[0] for line in told.err.strip().splitlines()] == [
        "step 0",
        "step 2",
        "step 4",
    ]
    log = [json.loads(line) for line in out.with_suffix(".jsonl").read_text().splitlines()]
    assert [entry["step"] for entry in log] == [0, 2, 4]
    plate = read_plate(out)
    assert plate.etching is not None
    assert plate.etching.levels == 16
    assert (out.parent / "small.safetensors").stat().st_size < 3000
    names = {"small.toml", "small.safetensors", "small.pt", "small.jsonl"}
    assert {path.name for path in out.parent.iterdir()} == names
    assert run(words) == ExitCode.USAGE
    assert "--resume" in capsys.readouterr().err
    assert run([*words, "--overwrite", "--steps", "1"]) == ExitCode.DONE
    assert "after 1 of 1 steps" in capsys.readouterr().out


def test_a_run_that_was_stopped_goes_on_to_the_same_plate(
    recipe: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, parts = (recipe.parent / name for name in ("whole.toml", "parts.toml"))
    assert run(["plate", "design", str(recipe), "-o", str(whole)]) == ExitCode.DONE
    words = ["plate", "design", str(recipe), "-o", str(parts)]
    assert run([*words, "--minutes", "1e-9"]) == ExitCode.DONE
    assert "after 1 of 4 steps" in capsys.readouterr().out
    assert run([*words, "--resume"]) == ExitCode.DONE
    heights = [path.with_suffix(".safetensors").read_bytes() for path in (whole, parts)]
    assert heights[0] == heights[1]
    assert run([*words, "--resume", "--seed", "9"]) == ExitCode.USAGE
    assert "belongs to another recipe" in capsys.readouterr().err
    parts.with_suffix(".pt").write_bytes(b"none")
    assert run([*words, "--resume"]) != ExitCode.DONE


def test_a_joint_design_tells_how_it_is_read_and_another_begins_at_its_end(
    recipe: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = recipe.parent
    write_camera(folder)
    lines = [f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v}" for k, v in READER.items()]
    text = RECIPE.replace("[0.55]", "[0.46, 0.54, 0.61]") + "\n[reader]\n" + "\n".join(lines)
    recipe.write_text(text, encoding="utf-8")
    out = folder / "joint.toml"
    assert run(["plate", "design", str(recipe), "-o", str(out), "--json"]) == ExitCode.DONE
    told = capsys.readouterr()
    report = json.loads(told.out)
    assert report["picture_loss"] < report["begin_picture_loss"]
    assert {"picture_db", "picture_capture_db", "begin_picture_db"} <= report.keys()
    assert all("read at " in line for line in told.err.strip().splitlines())
    logged = [json.loads(line) for line in out.with_suffix(".jsonl").read_text().splitlines()]
    assert [entry["step"] for entry in logged] == [0, 2, 4]
    best = min(logged, key=lambda entry: entry["loss"])
    assert best["picture_loss"] == pytest.approx(report["picture_loss"], abs=2e-6)
    words = ["plate", "design", str(recipe), "-o", str(out)]
    assert run([*words, "--resume"]) == ExitCode.DONE
    first = read_first_weights(out.with_suffix(".pt"), "small", "whole")
    assert first.whose == "the joint design joint"
    # plate and network go on together from where they were
    begin = 'kind = "rank"\nbegin = "joint.toml"'
    later = text.replace('kind = "rank"', begin) + '\nbegin = "joint.pt"\n'
    recipe.write_text(later, encoding="utf-8")
    on = folder / "later.toml"
    assert run(["plate", "design", str(recipe), "-o", str(on), "--json"]) == ExitCode.DONE
    report_on = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert report_on["begin_picture_loss"] == pytest.approx(report["picture_loss"], abs=2e-6)
    (folder / "camera.toml").write_text("# another\n" + (folder / "camera.toml").read_text())
    assert run(["plate", "design", str(recipe), "-o", str(on), "--resume"]) == ExitCode.USAGE
    assert "belongs to another recipe" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--minutes", "0"], "--minutes must be > 0"),
        (["--resume", "--overwrite"], "use one of them"),
        (["-o", "plate.json"], "written as .toml"),
    ],
)
def test_what_cannot_be_is_one_line_and_no_file(
    recipe: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = [] if "-o" in words else ["-o", str(recipe.parent / "new" / "x.toml")]
    assert run(["plate", "design", str(recipe), *out, *words]) == ExitCode.USAGE
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1
    assert message in told[0]
    assert [path.name for path in recipe.parent.iterdir()] == [recipe.name]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("side_px = 41", "side_px = 21"), "side_px >= 41"),
        (("cells = 96", "cells = 16"), "side_px is 18 at most"),
        (("rank = 1\n", "rank = 0\n"), "rank must be >= 1"),
        (("start = 0.1", 'begin = "none.toml"'), "none.toml"),
    ],
)
def test_a_recipe_that_cannot_begin_is_one_line_and_no_file(
    recipe: Path, change: tuple[str, str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe.write_text(RECIPE.replace(*change, 1), encoding="utf-8")
    out = recipe.parent / "new" / "x.toml"
    assert run(["plate", "design", str(recipe), "-o", str(out)]) == ExitCode.USAGE
    assert message in capsys.readouterr().err
    assert [path.name for path in recipe.parent.iterdir()] == [recipe.name]
