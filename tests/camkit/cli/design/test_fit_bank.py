"""`camkit fit-bank`: a recipe in, the recipe with its bank out."""

import json
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from camkit.cli.app import run
from camkit.cli.exit_code import ExitCode
from camkit.models_def.kinds.bayer import bank_fit
from camkit.models_def.training.bank_fitting import with_bank
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
    assert "exists; add --overwrite" in capsys.readouterr().err
    assert run([*words, "--overwrite"]) == 0


def test_too_few_samples_end_in_one_line(
    recipe_path: Path,  # noqa: F811
    out: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["fit-bank", str(recipe_path), "-o", str(out), "--samples", "2"]) == ExitCode.USAGE
    assert "raise --samples" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("[wiener]", "[ wiener ]"), "no table [wiener]"),
        (lambda text: text + "\n[wiener.together] # own\nown = {}\n", "wiener.together"),
    ],
)
def test_a_recipe_that_takes_no_bank_is_refused_before_anything_is_traced(
    recipe_path: Path,  # noqa: F811
    out: Path,
    monkeypatch: pytest.MonkeyPatch,
    change: Callable[[str], str],
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(bank_fit, "trace_material", lambda *_: pytest.fail("traced"))
    changed = out.with_name("changed.toml")
    changed.write_text(change(recipe_path.read_text(encoding="utf-8")), encoding="utf-8")
    assert run(["fit-bank", str(changed), "-o", str(out)]) != 0
    assert message in capsys.readouterr().err


def test_a_seed_below_nothing_is_refused(recipe_path: Path, out: Path) -> None:  # noqa: F811
    assert run(["fit-bank", str(recipe_path), "-o", str(out), "--seed", "-1"]) == ExitCode.USAGE


def test_a_folder_that_is_not_there_is_made(recipe_path: Path, tmp_path: Path) -> None:  # noqa: F811
    out = tmp_path / "new" / "with.toml"
    words = ["fit-bank", str(recipe_path), "-o", str(out), "--samples", "14", "--steps", "1"]
    assert run(words) == 0
    assert read_recipe(out).wiener.together is not None


def test_a_recipe_is_not_parted_from_the_lens_beside_it(
    recipe_path: Path,  # noqa: F811
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    name = read_recipe(recipe_path).lens.prescription
    (tmp_path / "own.toml").write_text("", encoding="utf-8")
    text = recipe_path.read_text(encoding="utf-8")
    moved = tmp_path / "moved.toml"
    moved.write_text(text.replace(f'"{name}"', '"own.toml"'), encoding="utf-8")
    assert run(["fit-bank", str(moved), "-o", str(tmp_path / "new" / "with.toml")]) != 0
    assert "relative to itself" in capsys.readouterr().err
    assert not list((tmp_path / "new").glob("*"))


@pytest.mark.parametrize("text", ["[wiener]\nblock_px = 512", "[wiener] # bank\nblock_px = 512\n"])
def test_ends_and_comments_of_a_table_stay(text: str) -> None:
    written = with_bank(text, bank_fit.FIRST)
    assert tomllib.loads(written)["wiener"]["block_px"] == 512
    assert written.startswith(text)
    assert with_bank(written, bank_fit.FIRST) == written
