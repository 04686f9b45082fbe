"""The check of a design by rays: agreement of a known lens, and what cannot be checked."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.models_def.design.recipe import read_design
from camkit.models_def.optics.search.variables import Variable
from tests.tiny_design import run_tool
from tools.design_check import check, parse

RECIPE = Path(__file__).resolve().parents[2] / "models_def" / "recipes" / "duet_joint_lens.toml"
SMALL = ("--fields", "2", "--patch-px", "16", "--spp", "32", "--passes", "2")


def test_rays_and_kernels_of_a_known_lens_agree(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.json"
    run_tool(monkeypatch, "design_check", RECIPE, "duet", "--depth-mm", 1000, *SMALL, "-o", out)
    written = json.loads(out.read_text(encoding="utf-8"))
    rows = written["rows"]
    printed = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert printed == [*rows, {"mean": written["mean"]}]
    assert [row["height_mm"] for row in rows] == [0.0, pytest.approx(21.7, abs=1.0)]
    for row in rows:
        assert row["agree_db"] > 30
        assert row["ray_noise_db"] > row["agree_db"]
        assert row["rays_db"] == pytest.approx(row["map_db"], abs=1.0)


def test_an_infinite_object_and_a_foreign_lens_are_refused() -> None:
    recipe = read_design(RECIPE)
    with pytest.raises(ContractError, match="--depth-mm"):
        next(check(recipe, parse([str(RECIPE), "duet"])))
    # the duet's conic is negative
    narrow = replace(recipe, variables=(Variable(kind="conic", surface=4, low=0.0, high=1.0),))
    with pytest.raises(ContractError, match="outside the bounds"):
        next(check(narrow, parse([str(RECIPE), "duet", "--depth-mm", "1000"])))
