"""What restorations are judged on: exact, blind to what nobody knows, the same for all methods."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer import training
from camkit.models_def.training.adversarial.content import Relu32
from tests.bayer_recipe import bank, material, recipe  # noqa: F401
from tests.normed_recipe import NORMED_RECIPE, recipe_path  # noqa: F401
from tools.tables.losses.domain import Domain, as_filtered, domain, judged_target
from tools.tables.losses.loss_table import table_of_distances

Maker = Callable[..., Domain]


@pytest.fixture
def at_home(tmp_path, monkeypatch, material) -> Maker:  # noqa: F811
    """Give samples of the tiny camera; its kernels need no tracing."""
    monkeypatch.setattr(training, "trace_material", lambda *_: material)
    path = tmp_path / "lab.toml"
    path.write_text(NORMED_RECIPE, encoding="utf-8")
    return partial(domain, path, tmp_path / "lab", None)


def test_a_perfect_restoration_is_seen_as_one(at_home: Maker) -> None:
    home = at_home(1)
    truth = home.samples[0].target[None]
    perfect = home.score(lambda _: truth, Relu32(None))
    assert perfect["psnr_db"] > 60
    assert perfect["ssim"] == pytest.approx(1, abs=1e-3)
    assert perfect["perceptual"] == pytest.approx(0, abs=1e-4)
    grey = home.score(lambda _: torch.full_like(truth, 0.1), Relu32(None))
    assert grey["psnr_db"] < 40
    assert grey["perceptual"] > perfect["perceptual"]


def test_decibels_are_told_by_distance_where_scenes_are_at_several(
    at_home: Maker,
) -> None:
    home = at_home(3)
    assert "at" not in home.score(as_filtered, Relu32(None))
    apart = replace(home, distances_mm=[math.inf, 500.0, math.inf])
    score = apart.score(as_filtered, Relu32(None))
    first, second, third = score["each"]["psnr_db"]
    assert list(score["at"]) == ["0.5 m", "infinity"]
    assert score["at"] == pytest.approx({"0.5 m": second, "infinity": (first + third) / 2})
    rows = {"a": {"wild": score}, "b": {"wild": {"at": {"infinity": 2.0}}}}
    assert table_of_distances(rows).splitlines()[-1] == "| b |  | 2.000 |"
    assert table_of_distances({"a": {"wild": home.score(as_filtered, Relu32(None))}}) == ""


def test_what_was_asked_as_the_bank_has_it_is_not_judged() -> None:
    planes = torch.rand(1, 6, 4, 4)
    target = torch.rand(1, 3, 4, 4)
    lost = torch.zeros(1, 1, 4, 4, dtype=torch.bool)
    lost[..., 1, 2] = True
    asked = torch.where(lost, planes[:, 3:], target)
    assert torch.equal(judged_target(asked, planes) == -1, lost.expand_as(target))
    assert torch.equal(judged_target(target, planes), target)


def test_a_method_stands_in_place_of_the_bank_on_the_same_captures(
    at_home: Maker,
) -> None:
    by_bank, by_method = at_home(2), at_home(2, "admm-tv")
    for ours, theirs in zip(by_bank.samples, by_method.samples, strict=True):
        assert torch.equal(ours.inputs["capture"], theirs.inputs["capture"])
    scores = [one.score(as_filtered, Relu32(None)) for one in (by_bank, by_method)]
    assert scores[0]["psnr_db"] != scores[1]["psnr_db"]


def test_a_camera_that_nobody_can_see_through_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "spad.toml"
    text = (Path(__file__).parents[4] / "models_def/recipes/spad_sr.toml").read_text()
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ContractError, match=r"has no sensor\.color_matrix, to see pictures"):
        domain(path, tmp_path / "out", None, 1)
