"""The whole chain on a tiny camera: samples, training, resuming, judging, page and chart."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.material import BayerMaterial
from camkit.models_def.networks.lean_unet import LeanConfig, LeanUnet
from camkit.models_def.training.fitter import Fitter, Objective
from camkit.models_def.training.kind import read_recipe
from camkit.models_def.training.sample import Batch
from tests.bayer_recipe import bank, material, recipe, recipe_path  # noqa: F401
from tests.psf_factory import texture
from tests.traced_once import traced_once  # noqa: F401
from tests.wide_bundle import write_wide_bundle
from tools.methods import __main__ as command
from tools.methods import equal_minutes, judging
from tools.methods.developers import DevelopingTime
from tools.methods.equal_minutes import Budget, objective_of, taught
from tools.methods.method_list import METHODS, Method
from tools.methods.sample_store import SampleStore

TINY = LeanConfig(widths=(16, 16), encoder_blocks=(0,), decoder_blocks=(0,), bias=True)
RECIPE = Path("models_def/recipes/duet.toml")
NAMES = ("S", "unet_capture", "hqs")


def run(monkeypatch: pytest.MonkeyPatch, *words: object) -> None:
    monkeypatch.setattr(sys, "argv", ["methods", *map(str, words)])
    command.main()


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch, material: BayerMaterial) -> None:  # noqa: F811
    """Train tiny blocks before a tiny lens, and judge through the lens as designed."""
    monkeypatch.setattr(
        "camkit.models_def.kinds.bayer.training.trace_material", lambda *_: material
    )
    monkeypatch.setattr(judging, "fabricated_optics", lambda bundle, *_, **__: bundle.frozen_optics)
    timed = DevelopingTime(title="one", version="1.0", cpu_s_per_mp=0.25, start_s=1.5)
    monkeypatch.setattr(command, "time_developers", lambda *_: [timed])
    for module, name, value in (
        (equal_minutes, "BLOCK_PX", 64),
        (judging, "ISOS", (100.0, 100.0, 100.0)),
        (judging, "POSITIONS", (0, 2)),
    ):
        monkeypatch.setattr(module, name, value)
    monkeypatch.setitem(
        METHODS,  # type: ignore[arg-type]
        "S",
        Method(title="S", build=lambda: LeanUnet(TINY), feeding="bank", learning_rate=2e-3),
    )


def test_methods_are_trained_for_their_minutes_judged_and_drawn(
    tiny: None,
    recipe_path: Path,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pictures, record = tmp_path / "pictures", tmp_path / "methods.json"
    pictures.mkdir()
    for name in "ab":
        pixels = np.rint(texture(80, 96) * 255).astype(np.uint8).transpose(1, 2, 0)
        cv2.imwrite(str(pictures / f"{name}.png"), pixels)
    shared = ("--data", pictures, "--work-dir", tmp_path / "work", "--minutes", 0.01)
    train = ("train", *shared, "--recipe", recipe_path, "--samples", 3)
    ending = tmp_path / "work" / "runs" / "S.json"
    run(monkeypatch, *train, "--methods", "S", "--minutes", 0.005)
    steps = json.loads(ending.read_text())["steps"]
    with pytest.raises(SystemExit, match=r"for 0\.005 CPU-minutes, not 0\.01"):
        run(monkeypatch, *train)
    ending.unlink()  # as if it had been stopped
    run(monkeypatch, *train, "--methods", ",".join(NAMES))
    resumed = json.loads(ending.read_text())
    assert resumed["steps"] > steps
    assert resumed["cpu_s"] < 0.015 * 60 + 3  # a step that begins in time may last
    before = ending.with_suffix(".pt").read_bytes()
    run(monkeypatch, *train, "--methods", "S")
    assert ending.with_suffix(".pt").read_bytes() == before
    tuned = tmp_path / "tuned.json"
    values = {
        "admm_tv": {"weight": 5, "iterations": 2},
        "skimage_rl": {"iterations": 2},
        "skimage_wiener": {"balance": 1},
    }
    by_iso = {name: {"100": setting} for name, setting in values.items()}
    tuned.write_text(json.dumps({"tuned": {"values": by_iso}}))
    judge = ("judge", *shared, "--tuned", tuned, "--rounds", 1, "--record", record)
    bundle = write_wide_bundle(tmp_path)
    run(monkeypatch, *judge, "--bundle", bundle.path, "--pictures", 1)
    assert "6 captures, 6 to do" in capsys.readouterr().out
    run(monkeypatch, *judge, "--bundle", bundle.path)
    written = json.loads(record.read_text())
    rows = {row["name"]: row for row in written["rows"]}
    assert set(NAMES) < rows.keys()
    assert rows["hqs"]["training"]["samples"] == 3
    assert rows["S"]["over_s"]["all"]["db"] == 0
    assert all(row["cpu_s_per_mp"] >= 0 for row in rows.values())
    page = record.with_suffix(".md").read_text()
    assert "| S | " in page
    assert "| one | 1.0 | 0.250 | 1.50 |" in page
    assert "- darktable: not installed here" in page
    for name in ("front.png", "front.svg"):
        run(monkeypatch, "chart", "--record", record, "-o", tmp_path / name)
    assert cv2.imread(str(tmp_path / "front.png")).min() < 100
    assert "HQS" in (tmp_path / "front.svg").read_text()


def test_other_minutes_and_unknown_methods_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SystemExit, match="methods are S, M"):
        run(monkeypatch, "train", "--data", tmp_path, "--methods", "L")


def test_torch_runs_on_one_thread(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(SystemExit):
        run(monkeypatch, "train", "--data", tmp_path, "--methods", "L")
    assert torch.get_num_threads() == 1


def test_a_lesson_counts_as_much_as_the_truth() -> None:
    plain = Objective(loss=lambda *given: given[1].target.mean())
    batch = Batch(
        inputs={"capture": torch.zeros(1, 3, 8, 8)},
        target=torch.full((1, 3, 8, 8), 4.0),
        weight=torch.ones(1, 3),
    )
    both = taught(plain, lambda one: torch.full_like(one.target, 1.0))
    assert float(both.loss(cast("Fitter", None), batch, 0, 0.0)) == 2.5


def test_a_teacher_is_trained_before_its_pupil(tmp_path: Path) -> None:
    store = cast("SampleStore", SimpleNamespace(recipe=read_recipe(RECIPE)))
    with pytest.raises(ContractError, match="XS, taught by M: train M before it"):
        objective_of(METHODS["XS_taught"], store, Budget(minutes=1, folder=tmp_path))
