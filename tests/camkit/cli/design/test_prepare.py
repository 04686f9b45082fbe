"""`camkit prepare`: frames of a camera with a haze, or a line that says why not."""

import json
from pathlib import Path

import pytest

from camkit.bundle.haze_file import write_haze
from camkit.bundle.psf_file import write_psf
from camkit.cli.exit_code import ExitCode
from camkit.export import frames
from camkit.models_def.optics.lens_file.lens_file import find_lens
from tests.bayer_recipe import RECIPE as PLAIN
from tests.hazy_recipe import RECIPE, hazy_optics

SMALL = RECIPE.replace("count = 2", "count = 1").replace("shots = 2", "shots = 1")


def _recipe(folder: Path, text: str) -> Path:
    path = folder / "tiny.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_frames_are_prepared_once(
    camkit_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    optics = hazy_optics()
    assert optics.haze is not None
    write_psf(tmp_path / "psf.safetensors", optics.psf)
    write_haze(tmp_path / "haze.safetensors", optics.haze)
    frozen = find_lens("duet", tmp_path), (hazy_optics(0.48), hazy_optics(0.5), hazy_optics(0.52))
    monkeypatch.setattr(frames, "freeze_copies", lambda *_: frozen)
    words = ("prepare", _recipe(tmp_path, SMALL), "--out-dir", tmp_path, "--json")
    outcome = camkit_command(*words)
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    assert (told["train"], told["valid"]) == (6, 4)
    assert Path(told["folder"]).name == "tiny_frames"
    assert "train: frame 1 of 1" in outcome.err
    again = camkit_command(*words)
    assert again.code == ExitCode.USAGE
    assert "--overwrite" in again.err


def test_a_recipe_without_a_haze_and_missing_optics_are_refused(
    camkit_command, tmp_path: Path
) -> None:
    outcome = camkit_command("prepare", _recipe(tmp_path, PLAIN), "--out-dir", tmp_path)
    assert outcome.code == ExitCode.USAGE
    assert "tiny has no haze; its samples are made while it trains" in outcome.err
    outcome = camkit_command("prepare", _recipe(tmp_path, RECIPE), "--out-dir", tmp_path)
    assert outcome.code != 0
    assert "cannot read the PSF" in outcome.err
