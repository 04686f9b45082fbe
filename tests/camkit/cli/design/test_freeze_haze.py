"""`camkit freeze --haze`: a lens to core kernels and haze, or a line that says why not."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from camkit.bundle.haze_file import read_haze
from camkit.bundle.psf_file import read_psf
from camkit.cli.exit_code import ExitCode
from camkit.models_def.optics.thin import distances, hazy_freezing

LENS = "thin-plate"
FEW = hazy_freezing.HazyGrid(fields=3, wavelengths=2, rays=1000)


def test_a_lens_is_frozen_as_core_and_haze(
    camkit_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hazy_freezing.freeze_hazy, "__defaults__", (FEW,))
    out, haze, report = (tmp_path / "frozen" / name for name in ("p.st", "h.st", "r.json"))
    words = ("freeze", LENS, "-o", out, "--haze", haze, "--report", report, "--json")
    outcome = camkit_command(*words)
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    assert told == json.loads(report.read_text())
    assert told["fields"] == 3
    assert told["haze_kept"] >= 0.995
    assert 0.1 < told["core_share"] < 0.4
    read_haze(haze).check_beside(read_psf(out))
    again = camkit_command(*words)
    assert again.code == ExitCode.USAGE
    assert "--overwrite" in again.err


def test_other_distances_are_frozen_beside_it(
    camkit_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hazy_freezing.freeze_hazy, "__defaults__", (FEW,))
    usual = dict(distances.freeze_distances.__kwdefaults__)
    near = usual | {"distances_mm": (1000.0,), "grid": replace(FEW, rays=500)}
    monkeypatch.setattr(distances.freeze_distances, "__kwdefaults__", near)
    out, haze, psf, beside = (tmp_path / name for name in ("p.st", "h.st", "sp.st", "sh.st"))
    words = ("freeze", LENS, "-o", out, "--haze", haze, "--stress-out", psf)
    outcome = camkit_command(*words)
    assert outcome.code == ExitCode.USAGE
    assert "--stress-out and --stress-haze go together" in outcome.err
    assert not out.exists()
    outcome = camkit_command(*words, "--stress-haze", beside, "--json")
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out)["distances"] == "1 m, infinity"
    assert read_psf(psf).depths_mm.tolist() == [1000.0, float("inf")]
    read_haze(beside).check_beside(read_psf(psf))
    again = camkit_command("freeze", LENS, "-o", tmp_path / "x.st", "--stress-haze", beside)
    assert "--overwrite" in again.err
    alone = ("freeze", LENS, "-o", tmp_path / "x.st", "--stress-haze", tmp_path / "y.st")
    assert "go together" in camkit_command(*alone).err


def test_nothing_is_written_where_no_other_distance_is_known(
    camkit_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hazy_freezing.freeze_hazy, "__defaults__", (FEW,))
    usual = dict(distances.freeze_distances.__kwdefaults__)
    nowhere = usual | {"distances_mm": (), "grid": replace(FEW, rays=500)}
    monkeypatch.setattr(distances.freeze_distances, "__kwdefaults__", nowhere)
    files = [tmp_path / name for name in ("p.st", "h.st", "sp.st", "sh.st")]
    options = ("-o", "--haze", "--stress-out", "--stress-haze")
    pairs = [word for pair in zip(options, files, strict=True) for word in pair]
    outcome = camkit_command("freeze", LENS, *pairs)
    assert outcome.code != 0
    assert "known at no other distance than its own" in outcome.err
    assert not any(file.exists() for file in files)


def test_what_haze_does_not_choose_is_refused(camkit_command, tmp_path: Path) -> None:
    out, haze = tmp_path / "p.st", tmp_path / "h.st"
    words = ("freeze", LENS, "-o", out, "--haze", haze)
    outcome = camkit_command(*words, "--energy", "0.9", "--focus-um", "3")
    assert outcome.code == ExitCode.USAGE
    assert "--haze conflicts with --energy, --focus-um" in outcome.err
    outcome = camkit_command("freeze", "streak-hdr", "-o", out, "--haze", haze)
    assert outcome.code != 0
    assert "--haze is for lenses only" in outcome.err
    assert not out.exists()
