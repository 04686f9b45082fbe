"""The reader of a joint design: its slope is that of the loss, it learns, it can be resumed."""

import copy
import math
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.design.plate.maps import begin_map
from camkit.models_def.design.plate.plate_loop import PlateLoop
from camkit.models_def.design.plate.plate_recipe import PlateRecipe
from camkit.models_def.design.plate.reader import (
    PlateReader,
    open_reader,
    picture_loss,
    reader_digest,
)
from camkit.models_def.design.plate.reader_recipe import ReaderRecipe
from tests.models_def.design.plate.joint_recipe import READER, joint, reader_of, write_camera
from tests.models_def.design.plate.test_plate_recipe import RECIPES


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_camera(tmp_path)
    return tmp_path


def _light() -> Tensor:
    """Give PSFs of three colours: a core with a cross, and a little beyond the window."""
    light = torch.zeros(3, 41, 41)
    light[:, 20, :] = light[:, :, 20] = 0.06 / 81
    light[:, 20, 20] = 0.93
    return light


def _loop(folder: Path, recipe: PlateRecipe) -> PlateLoop:
    assert recipe.reader is not None
    reader = open_reader(recipe.reader, psf_px=41, colours=3, seed=1, folder=folder)
    return PlateLoop(recipe, begin_map(recipe), reader)


def test_the_slope_is_that_of_the_loss_by_differences(folder: Path) -> None:
    reader = reader_of(folder, network_steps=1)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():  # a new network gives its input back
        for weight in reader.fitter.network.parameters():
            weight.add_(0.02 * torch.randn(weight.shape, generator=generator))
    begin = copy.deepcopy(reader.state())
    slope, _ = reader.follow(_light(), 3, 0.0)
    way = torch.rand(3, 41, 41, generator=generator)
    way[:, 20, 20] = -way.sum((-2, -1)) + way[:, 20, 20]
    losses = []
    for side in (1, -1):
        reader.load(copy.deepcopy(begin))
        losses.append(reader.follow(_light() + side * 2e-6 * way, 3, 0.0)[1])
    wanted = (losses[0] - losses[1]) / 4e-6
    assert float((slope * way).sum()) == pytest.approx(wanted, rel=0.03)
    assert abs(wanted) > 1e-3


def test_a_network_learns_to_read_behind_a_plate_that_stays(folder: Path) -> None:
    reader = reader_of(folder)
    begin = reader.judge(_light())
    assert begin.db == pytest.approx(begin.capture_db, abs=0.2)
    for step in range(30):
        reader.follow(_light(), step, 0.0)
    last = reader.judge(_light())
    assert last.loss < 0.97 * begin.loss
    assert last.capture_db == begin.capture_db


def test_the_loss_is_that_of_roots_by_hand() -> None:
    light = torch.tensor([0.0, 1.0, 99.999]).reshape(1, 3, 1, 1)
    roots = torch.tensor([0.0, 1.0, 7.0]).reshape(1, 3, 1, 1)
    # sqrt(1e-3) and sqrt(1.001) - 1 by squares, 10 - 7 by its distance
    wanted = (0.5e-3 + 0.5 * (math.sqrt(1.001) - 1) ** 2 + (3 - 0.5)) / 3
    assert float(picture_loss(roots, light)) == pytest.approx(wanted, rel=1e-5)


@pytest.mark.parametrize("etched", [False, True])
def test_a_joint_design_goes_on_in_the_same_bits(folder: Path, etched: bool) -> None:
    changes: dict[str, Any] = {
        "schedule": {"steps": 4, "rate": 0.05, "log_steps": 2, "etched": etched},
        "etching": {"range_um": 1.2, "levels": 16},
    }
    whole, first, second = (_loop(folder, joint(**changes)) for _ in range(3))
    moments = list(whole.run())
    list(first.run(last_step=2))
    second.load(copy.deepcopy(first.state()))
    again = list(second.run())
    assert again[-1].picture == moments[-1].picture
    assert again[-1].loss == moments[-1].loss
    assert torch.equal(second.height_map(), whole.height_map())
    assert moments[-1].picture is not None
    second.take_best()
    best = second.judge()
    assert best.loss == pytest.approx(second.best_loss, rel=1e-6)


def test_a_plate_that_is_held_stays_while_its_network_learns(folder: Path) -> None:
    loop = _loop(folder, joint({"hold_steps": 2}))
    begin = loop.height_map().detach().clone()
    weights = loop.reader.fitter.weights()  # type: ignore[union-attr]
    list(loop.run(last_step=2))
    assert torch.equal(loop.height_map(), begin)
    now = loop.reader.fitter.weights()  # type: ignore[union-attr]
    assert any(not torch.equal(weights[name], now[name]) for name in weights)
    list(loop.run(last_step=3))
    assert not torch.equal(loop.height_map(), begin)


def test_a_reader_that_has_not_learnt_takes_the_light_out_of_the_streaks(folder: Path) -> None:
    """Without the regulariser, as `tools.plate.collapse` at 2a55aa66 has it."""
    goal = {"near_px": 4.0, "far_px": 20.0, "core_weight": 0.0, "streak_weight": 0.0}
    schedule = {"steps": 8, "rate": 0.05, "log_steps": 8}
    loop = _loop(folder, joint(goal=goal, schedule=schedule))
    begin = loop.judge().shares
    *_, last = loop.run()
    assert last.loss == last.picture.loss  # type: ignore[union-attr]
    assert max(last.shares.streak_share) < 0.6 * min(begin.streak_share)
    assert min(last.shares.core_share) > max(begin.core_share) - 0.02


def test_without_weight_the_plate_goes_its_own_way(folder: Path) -> None:
    alone = joint()
    alone_loop = PlateLoop(alone, begin_map(alone))
    held = _loop(folder, joint({"weight": 0.0}))
    for loop in (alone_loop, held):
        list(loop.run(last_step=2))
    torch.testing.assert_close(held.height_map(), alone_loop.height_map(), rtol=0, atol=1e-6)


def test_a_digest_follows_what_the_table_only_names(folder: Path) -> None:
    chosen = ReaderRecipe(**READER)
    before = reader_digest(chosen, folder)
    assert before == reader_digest(chosen, folder)
    camera = folder / "camera.toml"
    camera.write_text(camera.read_text("utf-8") + "\n# another\n", encoding="utf-8")
    assert reader_digest(chosen, folder) != before


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"recipe": "none.toml"}, "cannot read recipe none.toml"),
        ({"recipe": str(RECIPES / "duet.toml")}, 'of a camera of the kind "hdr"'),
        ({"size": "large"}, "has the sizes small, chain, two; got 'large'"),
        ({"size": "chain"}, "losses of its own"),
        ({"size": "two"}, "lean_s does not take the 3 channels of its role"),
        ({"patch_px": 30}, "multiple of 4"),
        ({"scene_px": 64}, "reader.scene_px >= 72; got 64"),
        ({"begin": "none.pt"}, "cannot read checkpoint of camkit none.pt"),
    ],
)
def test_a_reader_that_cannot_be_is_refused(
    folder: Path, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ContractError, match=message):
        reader_of(folder, **changes)


def test_a_reader_wants_three_colours(folder: Path) -> None:
    with pytest.raises(ContractError, match="for R, G and B, 3 of them; got 1"):
        open_reader(ReaderRecipe(**READER), psf_px=41, colours=1, seed=1, folder=folder)


def test_a_reader_is_found_without_a_folder() -> None:
    chosen = ReaderRecipe(recipe=str(RECIPES / "streak_thesis.toml"), size="lean_s")
    assert isinstance(open_reader(chosen, psf_px=41, colours=3, seed=1), PlateReader)
