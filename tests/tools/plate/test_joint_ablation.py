"""The ablation of joint designs: what runs differ in, and where light goes, told by colour."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from camkit.models_def.design.plate.maps import begin_map
from camkit.models_def.optics.diffraction.patterns import CrossPattern
from tools.plate import joint_ablation
from tools.plate.joint_ablation import READER, main, measured, recipes_of, run_one

SMALL: dict[str, Any] = {
    "size": "lean_s",
    "network_steps": 1,
    "batch": 1,
    "patch_px": 32,
    "scenes": 1,
    "scene_px": 168,
    "valid_patches": 1,
}


def test_runs_differ_in_what_they_are_named_by() -> None:
    runs = recipes_of(10, 1, READER)
    rank, free = runs["rank"], runs["rank-free"]
    assert (rank.goal.core_weight, rank.goal.streak_weight) == (0.05, 0.1)
    same = replace(free, name="rank", goal=rank.goal)
    assert same == rank
    for name in ("rank-free", "full-free", "full-free-blind"):
        assert runs[name].goal.core_weight == runs[name].goal.streak_weight == 0
    for name in ("full", "full-free", "full-hold"):
        recipe = runs[name]
        assert (recipe.map.kind, recipe.map.begin) == ("full", "rank.toml")
        assert recipe.reader is not None
        assert recipe.reader.begin == "rank.pt"
    blind, held, bare = (runs[name].reader for name in ("full-free-blind", "full-hold", "bare"))
    assert blind is not None
    assert blind.begin == ""
    assert held is not None
    assert held.hold_steps == runs["full-hold"].schedule.steps == 5
    assert bare is not None
    assert bare.hold_steps == runs["bare"].schedule.steps == 10
    assert not begin_map(runs["bare"])().any()
    assert {recipe.name for recipe in runs.values()} == set(runs)


def test_a_cross_is_told_by_its_shares_and_its_reach_and_no_plate_has_none() -> None:
    recipe = recipes_of(1, 1, READER)["rank"]
    cross = CrossPattern(near_um=48.0, far_um=360.0, share=0.06)
    height_um = cross.rank_map(recipe.bench, lambda _: 1.46, recipe.cells)()
    found = measured(recipe, height_um.detach().float())
    for core, streak, haze in zip(
        found["core_share"], found["streak_share"], found["haze_share"], strict=True
    ):
        assert core + streak + haze == pytest.approx(1, abs=2e-4)
    assert found["written"][1] == pytest.approx(0.046, abs=0.006)
    # energy as ((n - 1) / wavelength)^2
    assert found["written"][0] > found["written"][1] > found["written"][2]
    assert found["core_of_bare"][1] == pytest.approx(0.94, abs=0.015)
    assert sorted(found["angles_deg"]) == pytest.approx([0, 90], abs=0.5)
    assert found["reach_px"][1] == pytest.approx(60, abs=4)
    flat = measured(recipe, torch.zeros(recipe.cells, recipe.cells))
    assert flat["core_of_bare"] == [1, 1, 1]
    assert flat["written"] == flat["reach_px"] == [0, 0, 0]
    assert flat["core_share"] == flat["bare_core_share"] == found["bare_core_share"]


def test_the_command_writes_its_rows_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(joint_ablation, "READER", SMALL)
    monkeypatch.setattr("tools.plate.joint_ablation.RADII_PX", (2,))
    words = ["--out-dir", str(tmp_path), "--steps", "2"]
    main([*words, "--runs", "rank", "full-hold"])
    told = json.loads((tmp_path / "plate-joint.json").read_text("utf-8"))
    rank, held = told["rows"]["rank"], told["rows"]["full-hold"]
    assert (rank["steps"], rank["of_steps"], held["steps"]) == (2, 2, 1)
    assert rank["moved_um"] > 0
    assert held["moved_um"] == 0
    assert held["begin"]["core_share"] == held["end"]["core_share"]
    assert {"picture_loss", "picture_db", "linear_db", "reach_px"} <= held["end"].keys()
    again = run_one(recipes_of(2, 1, SMALL)["rank"], tmp_path, 1.0)
    assert again["cpu_s"] == rank["cpu_s"]
    assert again["begin"] == rank["begin"]
    with pytest.raises(SystemExit):
        main([*words, "--runs", "none"])
    assert "there is no run 'none'" in capsys.readouterr().err
