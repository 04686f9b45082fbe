"""`camkit prepare`: frames of a camera with a haze, or a line that says why not."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from camkit.bundle.haze_file import write_haze
from camkit.bundle.psf_file import write_psf
from camkit.cli.exit_code import ExitCode
from camkit.errors import UnsupportedError
from camkit.models_def.kinds.bayer.frames import preparation
from camkit.models_def.training.preparing import preparing_kind
from tests.bayer_recipe import RECIPE as PLAIN
from tests.hazy_recipe import RECIPE, hazy_optics

SMALL = RECIPE.replace("count = 2", "count = 1").replace("shots = 2", "shots = 1")


def _recipe(folder: Path, text: str) -> Path:
    path = folder / "tiny.toml"
    path.write_text(text, encoding="utf-8")
    return path


def _write_optics(folder: Path, *, stretched: float = 1.0) -> None:
    """Write optics whose peaks lie where those of the lens do, or so many times further out."""
    optics = hazy_optics()
    assert optics.haze is not None
    own = optics.psf.distortion
    distortion = replace(own, coefficients=own.coefficients * stretched)
    write_psf(folder / "psf.safetensors", replace(optics.psf, distortion=distortion))
    write_haze(folder / "haze.safetensors", optics.haze)


def test_frames_are_prepared_once(
    camkit_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _write_optics(tmp_path)
    frozen = (hazy_optics(0.48), hazy_optics(0.5), hazy_optics(0.52))
    monkeypatch.setattr(preparation, "freeze_copies", lambda *_: frozen)
    monkeypatch.setattr("camkit.cli.progress.SILENT_S", 0.0)
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


def test_what_would_fail_later_is_refused_before_copies_are_frozen(
    camkit_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preparation, "freeze_copies", lambda *_: pytest.fail("frozen in vain"))
    _write_optics(tmp_path)
    words = ("prepare", _recipe(tmp_path, RECIPE), "--out-dir", tmp_path)
    outcome = camkit_command(*words, "--valid", tmp_path / "none")
    assert outcome.code == ExitCode.USAGE
    assert "none is not there" in outcome.err
    large = _recipe(tmp_path, RECIPE.replace("sample_px = 64", "sample_px = 256"))
    outcome = camkit_command("prepare", large, "--out-dir", tmp_path)
    assert outcome.code == ExitCode.USAGE
    assert "sample_px (256)" in outcome.err
    _write_optics(tmp_path, stretched=1.2)
    outcome = camkit_command("prepare", _recipe(tmp_path, RECIPE), "--out-dir", tmp_path)
    assert outcome.code == ExitCode.USAGE
    assert "was not frozen from the lens" in outcome.err


def test_kinds_without_frames_are_told_so() -> None:
    for name in ("hdr", "spad"):
        with pytest.raises(UnsupportedError, match=f"kind '{name}' are made while it trains"):
            preparing_kind(name)
