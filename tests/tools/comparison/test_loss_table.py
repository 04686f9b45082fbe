"""The table of losses on two rows of a tiny camera: table, journal, nothing done again."""

import json
from pathlib import Path

import pytest
import torch

from camkit.models_def.kinds.bayer import training, validation
from tests.bayer_recipe import RECIPE, bank, material, recipe, recipe_path  # noqa: F401
from tests.tiny_design import run_tool
from tools.comparison import loss_table
from tools.comparison.loss_table import METRICS

NETWORKS = """
[networks.supervised]
network = "normed_unet"
config = { width = 4, stages = 3 }
schedule = { loss = "l1", steps = 2, precision = "float32" }

[networks.adversarial]
network = "normed_unet"
config = { width = 4, stages = 3 }

[networks.adversarial.schedule]
loss = "adversarial"
steps = 2
precision = "float32"
critic = { layers = 2, width = 4, steps = 1 }
"""


@pytest.fixture
def recipes(tmp_path, monkeypatch, material):  # noqa: F811
    """The tiny camera at home, and with more light; its kernels need no tracing."""
    monkeypatch.setattr(validation, "PROCEDURAL_PICTURES", 1)
    monkeypatch.setattr(training, "trace_material", lambda *_: material)
    lab, wild = tmp_path / "lab.toml", tmp_path / "wild.toml"
    lab.write_text(RECIPE + NETWORKS, encoding="utf-8")
    brighter = RECIPE.replace("[data]", "[data]\nlamp_share = 1.0\nexposure_max_ev = 2.0")
    wild.write_text(brighter + NETWORKS, encoding="utf-8")
    return lab, wild


def test_rows_are_trained_once_and_judged_at_home_and_abroad(
    recipes: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    lab, wild = recipes
    out = tmp_path / "out"
    options = [lab, "--wild", wild, "--rows", "supervised", "adversarial", "--samples", 2]
    options += ["--minutes", 10, "--out-dir", out]
    assert run_tool(monkeypatch, "comparison.loss_table", *options) == 0
    report = json.loads((out / "loss_table.json").read_text(encoding="utf-8"))
    rows = report["rows"]
    assert list(rows) == ["capture", "wiener", "supervised", "adversarial"]
    assert all(
        set(METRICS) <= set(row[where]) for row in rows.values() for where in ("lab", "wild")
    )
    assert rows["supervised"]["trained"]["steps"] == 2
    # two steps from the bank: still close to it
    gap = rows["supervised"]["lab"]["psnr_db"] - rows["wiener"]["lab"]["psnr_db"]
    assert abs(gap) < 3
    assert rows["capture"]["lab"]["psnr_db"] != rows["capture"]["wild"]["psnr_db"]
    assert "| adversarial |" in (out / "loss_table.md").read_text(encoding="utf-8")
    monkeypatch.setattr(loss_table, "measure", lambda *_: pytest.fail("measured again"))
    assert run_tool(monkeypatch, "comparison.loss_table", *options) == 0


def test_a_perfect_restoration_is_seen_as_one(recipes: tuple[Path, Path], tmp_path: Path) -> None:
    conditions = loss_table.Conditions(
        wild=recipes[1],
        data=None,
        fresh=None,
        sharp=None,
        vgg=None,
        minutes=1.0,
        samples=1,
        out_dir=tmp_path,
    )
    home = loss_table.domain(recipes[0], conditions)
    truth = home.samples[0].target[None]
    perfect = home.score(lambda _: truth, loss_table.Relu32(None))
    assert perfect["psnr_db"] > 60
    assert perfect["ssim"] == pytest.approx(1, abs=1e-3)
    assert perfect["perceptual"] == pytest.approx(0, abs=1e-4)
    grey = home.score(lambda _: torch.full_like(truth, 0.1), loss_table.Relu32(None))
    assert grey["psnr_db"] < 40
    assert grey["perceptual"] > perfect["perceptual"]
