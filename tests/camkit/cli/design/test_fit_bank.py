"""`camkit fit-bank`: a recipe in, the recipe with its bank out."""

import json
from pathlib import Path

import pytest

from camkit.cli.app import run
from camkit.cli.exit_code import ExitCode
from camkit.models_def.kinds.bayer import bank_fit
from camkit.models_def.training.kind import read_recipe
from tests.bayer_recipe import bank, material, recipe, recipe_path  # noqa: F401


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "with.toml"


@pytest.fixture(autouse=True)
def traced(monkeypatch: pytest.MonkeyPatch, material: object) -> None:  # noqa: F811
    monkeypatch.setattr(bank_fit, "trace_material", lambda *_: material)


def test_the_recipe_is_written_with_its_bank(
    recipe_path: Path,  # noqa: F811
    out: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["fit-bank", str(recipe_path), "-o", str(out), "--samples", "14", "--steps", "5"]
    assert run([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    found = read_recipe(out).wiener.together
    assert found is not None
    assert told["own"] == found.own
    assert told["output"] == str(out)
    assert {"samples", "steps", "gain_db", "noise", "mistrust"} <= set(told)
    # and nothing is written over
    assert run(words) == ExitCode.USAGE
    assert "exists; say --overwrite" in capsys.readouterr().err
    assert run([*words, "--overwrite"]) == 0


def test_too_few_samples_end_in_one_line(
    recipe_path: Path,  # noqa: F811
    out: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["fit-bank", str(recipe_path), "-o", str(out), "--samples", "2"]) == ExitCode.USAGE
    assert "raise --samples" in capsys.readouterr().err
    assert not out.exists()
