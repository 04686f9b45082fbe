"""One step moves each player by its own loss; a run that is resumed keeps its bits."""

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer import fitting
from camkit.models_def.kinds.bayer.fine_tuning.pairs import PairSamples
from camkit.models_def.kinds.bayer.samples import LAYOUT
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.training.adversarial.picture_fitter import PictureParts, picture_fitter
from camkit.models_def.training.adversarial.picture_fitting import critic_plan
from camkit.models_def.training.adversarial.sharp import SharpCrops
from camkit.models_def.training.checkpoint import read_checkpoint
from camkit.models_def.training.fitter import patch_objective
from camkit.models_def.training.fitting import FitRequest, own_fitting
from camkit.models_def.training.kind import read_recipe, to_recipe
from camkit.models_def.training.log import read_log
from camkit.models_def.training.sample import Batch
from camkit.models_def.training.trainer import TrainOptions, train
from tests.bayer_recipe import RECIPE


@pytest.fixture
def make(recipe_path):
    def build(size="adversarial", critic=None, sharp=None, **changes):
        entry = read_recipe(recipe_path).network(size)
        schedule = entry.schedule
        schedule = replace(schedule, critic=replace(schedule.critic, **critic or {}), **changes)
        judged = schedule.loss == "adversarial"
        parts = PictureParts(
            content=schedule.content,
            to_rec709=torch.eye(3),
            opponents=critic_plan(schedule, sharp) if judged else None,
            betas=(schedule.critic.beta1 if judged else 0.9, 0.999),
        )
        return picture_fitter(replace(entry, schedule=schedule), build_network, parts)

    return build


def batch(seed=0):
    draw = torch.Generator().manual_seed(seed)
    planes = torch.rand(2, 6, 32, 32, generator=draw)
    target = torch.rand(2, 3, 32, 32, generator=draw)
    return Batch(inputs=LAYOUT.by_name(planes), target=target, weight=torch.ones(2, 3))


def equal(one, other):
    return all(torch.equal(one[name], other[name]) for name in one)


def options(folder, **changes):
    return TrainOptions(**({"out_dir": folder, "size": "adversarial", "workers": 0} | changes))


def test_the_critic_learns_to_tell_truth_from_output(make):
    fitter = make(critic={"learning_rate": 1e-2, "steps": 5}, warmup_steps=1, learning_rate=1e-6)
    apart = []
    for step in range(8):
        fitter.fit(batch(), step, 0.0)
        apart.append(fitter.notes()["critic"])
    assert apart[-1] < apart[0] - 0.1


def test_without_weight_the_critic_leaves_the_generator_to_its_content(make):
    alone, judged = make(loss="content"), make(critic={"weight": 0.0, "beta1": 0.9})
    for fitter in (alone, judged):
        fitter.fit(batch(), 0, 0.0)
    assert equal(alone.weights(), judged.weights())
    pulled = make(critic={"weight": 10.0, "beta1": 0.9})
    pulled.fit(batch(), 0, 0.0)
    assert not equal(alone.weights(), pulled.weights())


def test_scores_of_the_generator_do_not_move_the_critic(make):
    fitter = make(critic={"learning_rate": 1e-30})
    critic = fitter.objective.states["opponents"].networks
    before = {n: p.clone() for n, p in critic.named_parameters()}
    fitter.fit(batch(), 0, 0.0)
    assert all(torch.allclose(p, before[n], atol=1e-9) for n, p in critic.named_parameters())


def test_notes_tell_every_term_once(make, sharp_folder):
    fitter = make(sharp=SharpCrops(sharp_folder))
    fitter.fit(batch(), 0, 0.0)
    assert set(fitter.notes()) == {"critic", "penalty", "l1", "adversarial"}
    assert fitter.notes() == {}


def test_resumed_training_equals_uninterrupted_training_to_the_last_bit(
    tmp_path, recipe_path, material, sharp_folder
):
    whole = train(
        recipe_path, options(tmp_path / "a", sharp_folder=sharp_folder), material=material
    )
    given = options(tmp_path / "b", sharp_folder=sharp_folder, stop_at_step=3)
    train(recipe_path, given, material=material)
    given = options(tmp_path / "b", sharp_folder=sharp_folder, resume=True)
    resumed = train(recipe_path, given, material=material)
    one, two = read_checkpoint(whole.checkpoint), read_checkpoint(resumed.checkpoint)
    assert (one.step, two.step) == (6, 6)
    assert equal(one.weights, two.weights)
    assert equal(one.average, two.average)
    critics = [c.optimizer["opponents"] for c in (one, two)]
    assert equal(*(c["weights"] for c in critics))
    assert equal(*(c["optimizer"]["state"][0] for c in critics))
    assert one.training_data.endswith("by the loss adversarial, sharp pictures of sharp0")
    assert one.best == {}  # decibels are not what an adversary wants


@pytest.mark.parametrize(
    ("size", "said"),
    [("gram", "by the loss content, random features in place of VGG-19"), ("l1", "no photographs")],
)
def test_other_losses_of_the_table_train_too(tmp_path, recipe_path, material, size, said):
    result = train(recipe_path, options(tmp_path, size=size), material=material)
    assert said in read_checkpoint(result.checkpoint).training_data
    assert read_log(result.log)[-1]["step"] == 3


def test_a_checkpoint_of_another_loss_is_not_resumed(make):
    judged, alone = make(), make(loss="content")
    with pytest.raises(ContractError, match="trained by another loss"):
        alone.load(judged.weights(), judged.average(), judged.optimizer_state())
    plain = make(loss="l1")
    plain.objective = patch_objective()
    with pytest.raises(ContractError, match="trained by another loss"):
        alone.load(plain.weights(), plain.average(), plain.optimizer_state())
    with pytest.raises(ContractError, match="trained by another loss"):
        plain.load(alone.weights(), alone.average(), alone.optimizer_state())


def test_a_checkpoint_of_another_critic_is_not_resumed(make):
    narrow, wide = make(), make(critic={"width": 8})
    with pytest.raises(ContractError, match="a critic or discriminators of another shape"):
        wide.load(narrow.weights(), narrow.average(), narrow.optimizer_state())


def test_real_pairs_take_the_places_that_the_recipe_gives_them(recipe_path, material, monkeypatch):
    planes = np.full((3, 6, 64, 64), 0.25, dtype=np.float16)
    pairs = PairSamples(
        planes=planes, targets=planes[:, :3], weights=np.ones((3, 3), np.float32), alignments={}
    )
    asked = []
    monkeypatch.setattr(fitting, "trace_recipe_distortion", lambda *_: None)
    monkeypatch.setattr(fitting, "read_pairs", lambda *given, **_: asked.append(given) or pairs)
    recipe = read_recipe(recipe_path)
    own = own_fitting("bayer", request(recipe, "gram", pairs=Path("monitor")))
    assert own.credit.endswith(", real pairs of monitor")
    fitter = own.make(material)
    given = []
    run = fitter.run
    monkeypatch.setattr(
        fitter, "run", lambda planes, progress: given.append(planes) or run(planes, progress)
    )
    assert fitter.fit(batch(), 7, 0.0) > 0
    assert asked == [(Path("monitor"), recipe, material.bank, None)]
    assert (given[0][0] == 0.25).all()
    assert torch.equal(given[0][1], batch().planes[1])


def request(recipe, size, **given):
    return FitRequest(recipe=recipe, role="restore", entry=recipe.network(size), **given)


def test_files_that_no_term_looks_at_are_refused(recipe_path, sharp_folder):
    recipe = read_recipe(recipe_path)
    for size, given, said in (
        ("l1", {"sharp": sharp_folder}, "does not look at sharp pictures without captures: leave"),
        ("l1", {"pairs": sharp_folder, "vgg": sharp_folder}, "does not look at VGG-19: leave"),
        ("gram", {"sharp": sharp_folder}, "the loss content has no critic: leave sharp away"),
        ("adversarial", {"vgg": sharp_folder / "x.pth"}, "looks at no features .* vgg away"),
    ):
        with pytest.raises(ContractError, match=said):
            own_fitting("bayer", request(recipe, size, **given))
    with pytest.raises(ContractError, match="does not look at real pairs: leave pairs away"):
        own_fitting("spad", request(recipe, "l1", pairs=sharp_folder))
    with pytest.raises(ContractError, match="kind 'spad' cannot be trained by the loss advers"):
        own_fitting("spad", request(recipe, "adversarial"))


@pytest.mark.parametrize(
    ("schedule", "said"),
    [
        ({"critic": 3}, "schedule.critic must be a table"),
        ({"critic": {"lambda": 1.0}}, "schedule.critic: unknown key 'lambda'"),
        ({"critic": {"steps": 0}}, "steps, layers and width >= 1"),
        ({"critic": {"beta1": 1.0}}, r"beta1 in \[0, 1\)"),
        ({"critic": {"penalty": -1.0}}, "penalty >= 0"),
        ({"content": {"l1_weight": 0.0}}, "weights >= 0, one > 0"),
        ({"critic": {"weight": math.nan}}, "schedule.critic.weight must be a number; got nan"),
        ({"loss": "gan"}, "schedule.loss must be one of"),
        ({"loss": "content", "overshoot": 1.5}, "content has no term for overshoots"),
    ],
)
def test_tables_of_the_losses_are_checked(schedule, said):
    table = tomllib.loads(RECIPE)
    table["schedule"] |= schedule
    with pytest.raises(ContractError, match=said):
        to_recipe(table)


def test_a_network_changes_single_weights_of_the_common_table(recipe_path):
    critic = read_recipe(recipe_path).network("adversarial").schedule.critic
    assert (critic.layers, critic.steps, critic.weight, critic.penalty) == (2, 2, 0.1, 10.0)
    table = tomllib.loads(RECIPE)
    table["schedule"]["critic"] = {"width": 8}
    table["networks"]["M"]["schedule"]["critic"] = {"weight": 0.5}
    changed = to_recipe(table).network("M").schedule.critic
    assert (changed.width, changed.weight) == (8, 0.5)
