"""tools/design_stability.py on a tiny design: all arms, resumed without work done twice."""

import importlib
import json
from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.lens_file import read_lens

RECIPE = """
name = "tiny"
prescription = "duet"
optics = { half_field_deg = 12.0, fields = 2, pupil_rays = 24, efl_mm = 50.0, solved_surface = 4 }
pixels = { pitch_um = 6.0, kernel_px = 33 }
loss = { kind = "log_mse" }
data = { procedural_scenes = 1, scene_px = 160 }
vary = [
    { kind = "curvature", surface = 1, low = -0.1, high = 0.1 },
    { kind = "conic", surface = 4, low = -4.0, high = 4.0 },
    { kind = "defocus", low = -2.0, high = 2.0 },
]

[schedule]
steps = 2
batch = 1
patch_px = 24
epoch_steps = 2
valid_steps = 2
valid_patches = 1
"""


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> None:
    module = importlib.import_module("tools.design_stability")
    monkeypatch.setattr("sys.argv", ["design_stability", *map(str, arguments)])
    module.main()


def test_arms_share_their_starts_and_a_finished_run_is_not_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe, out = tmp_path / "tiny.toml", tmp_path / "out"
    recipe.write_text(RECIPE, encoding="utf-8")
    size = ("--starts", 1, "--steps", 3, "--finalists", 1)
    run(monkeypatch, recipe, "--out-dir", out, *size, "--arms", "before,curriculum")
    lines = (out / "trials.jsonl").read_text(encoding="utf-8").splitlines()
    trials = [json.loads(line) for line in lines]
    assert [(t["arm"], t["stage"]) for t in trials] == [
        *(("before", "box"), ("curriculum", "box")),
        *(("before", "end"), ("curriculum", "end")),
    ]
    efl_mm = {t["arm"]: t["efl_mm"] for t in trials}
    assert efl_mm["curriculum"] == pytest.approx(50, abs=1e-6)
    assert abs(efl_mm["before"] - 50) > 0.01
    assert "| before | ± 5 % |" in capsys.readouterr().out
    off = read_lens(out / "starts" / "00.toml").surfaces[1].radius_mm / -14.2857
    assert 0 < abs(off - 1) < 0.06
    run(monkeypatch, recipe, "--out-dir", out, *size, "--arms", "before,curriculum")
    assert (out / "trials.jsonl").read_text(encoding="utf-8").splitlines() == lines
    with pytest.raises(ContractError, match="other settings"):
        run(monkeypatch, recipe, "--out-dir", out, "--starts", 1, "--steps", 4)
