"""tools/design_stability.py on a tiny design: all arms, resumed without work done twice."""

import json
from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.lens_file import read_lens
from tests.tiny_design import RECIPE, run_tool


def test_arms_share_their_starts_and_a_finished_run_is_not_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe, out = tmp_path / "tiny.toml", tmp_path / "out"
    recipe.write_text(RECIPE, encoding="utf-8")
    size = ("--starts", 1, "--steps", 3, "--finalists", 1)
    command = (recipe, "--out-dir", out, *size, "--arms", "before,curriculum")
    run_tool(monkeypatch, "design_stability", *command)
    lines = (out / "trials.jsonl").read_text(encoding="utf-8").splitlines()
    trials = [json.loads(line) for line in lines]
    assert [(t["arm"], t["run"]) for t in trials] == [
        *(("before", "box"), ("curriculum", "box")),
        *(("before", "end"), ("curriculum", "end")),
    ]
    efl_mm = {t["arm"]: t["efl_mm"] for t in trials}
    assert efl_mm["curriculum"] == pytest.approx(50, abs=1e-6)
    assert abs(efl_mm["before"] - 50) > 0.01
    assert "| before | ± 5 % |" in capsys.readouterr().out
    off = read_lens(out / "starts" / "00.toml").surfaces[1].radius_mm / -14.2857
    assert 0 < abs(off - 1) < 0.06
    run_tool(monkeypatch, "design_stability", *command)
    assert (out / "trials.jsonl").read_text(encoding="utf-8").splitlines() == lines
    with pytest.raises(ContractError, match="other settings"):
        run_tool(
            monkeypatch, "design_stability", recipe, "--out-dir", out, "--starts", 1, "--steps", 4
        )
