"""tools/design_start.py on a search of three starts."""

from pathlib import Path

import pytest

from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import read_prescription
from tests.tiny_design import run_tool

RECIPE = Path(__file__).resolve().parents[2] / "models_def" / "recipes" / "duet_lens.toml"
LESS = {"starts": 3, "scout_steps": 1, "kept": 1, "steps": 1, "fields": 3, "pupil_rays": 6}


def test_the_found_lens_is_written_where_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe, lens = tmp_path / "small.toml", tmp_path / "lens.toml"
    lines = RECIPE.read_text(encoding="utf-8").splitlines()
    keys = [line.partition(" =")[0] for line in lines]
    small = [f"{k} = {LESS[k]}" if k in LESS else x for k, x in zip(keys, lines, strict=True)]
    recipe.write_text("\n".join(small), encoding="utf-8")
    run_tool(monkeypatch, "design_start", recipe, "-o", lens)
    assert paraxial_data(read_prescription(lens)).efl_mm == pytest.approx(50, abs=2e-3)
    assert f"written to {lens}" in capsys.readouterr().out
