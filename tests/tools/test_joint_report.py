"""tools/joint_report.py on a tiny design: budgets, a given joint lens, nothing done twice."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.tiny_design import RECIPE, run_tool

JUDGED = """
starts = { count = 4, scout_steps = 1, dls_steps = 1, judged = 2 }
front = { kind = "wiener", filter_margin_px = 8 }
network = { name = "lean_s" }
"""


def test_spots_get_their_share_of_lenses_and_nothing_is_done_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe, out = tmp_path / "tiny.toml", tmp_path / "out"
    recipe.write_text(JUDGED + RECIPE, encoding="utf-8")
    size = ("--times", 3, "--network-steps", 1, "--seeds", "5")
    run_tool(monkeypatch, "joint_report", recipe, "--out-dir", out, *size)

    def made(name: str) -> dict[str, Any]:
        found: dict[str, Any] = json.loads((out / name).read_text(encoding="utf-8"))
        return found

    report = made("joint.json")
    # 4 starts of 1 step, 2 kept for another, 3 judged, 2 steps of the loop; 5 lenses a step
    assert report["joint_evaluations"] == 4 * 6 + 2 * 6 + 3 + 2
    for merit in ("rms", "sum_abs", "energy"):
        assert made(f"spots_{merit}.json")["evaluations"] >= 3 * report["joint_evaluations"]
    trained = [name for name, entry in report["lenses"].items() if entry["networks"]]
    assert (trained[0], trained[-1], len(trained)) == ("start", "joint", 3)
    assert len(made("joint_lens.json")["curve"]) == 2
    files = {path: path.stat().st_mtime_ns for path in out.glob("*_*.json")}
    run_tool(monkeypatch, "joint_report", recipe, "--out-dir", out, *size)
    assert {path: path.stat().st_mtime_ns for path in out.glob("*_*.json")} == files


def test_a_finished_joint_lens_may_be_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe, out = tmp_path / "tiny.toml", tmp_path / "out"
    recipe.write_text(JUDGED + RECIPE, encoding="utf-8")
    alone = ("--times", 1, "--network", "none")
    run_tool(monkeypatch, "joint_report", recipe, "--out-dir", out, *alone, "--joint", "duet")
    lenses = json.loads((out / "joint.json").read_text(encoding="utf-8"))["lenses"]
    assert lenses["joint"]["front_db"] == lenses["start"]["front_db"]
    assert not (out / "joint_lens.json").exists()
