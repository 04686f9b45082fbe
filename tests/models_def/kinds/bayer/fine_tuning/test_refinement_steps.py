"""A step of fine-tuning moves each player by its own loss, and draws pairs by the step."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.fine_tuning.bayer_refinement import make_refinement
from camkit.models_def.kinds.bayer.fine_tuning.pairs import PairSamples
from camkit.models_def.kinds.bayer.samples import LAYOUT
from camkit.models_def.training.kind import to_recipe
from camkit.models_def.training.refinement import FineTuningOptions
from camkit.models_def.training.sample import Batch
from tests.bayer_recipe import RECIPE


@pytest.fixture
def make(recipe, material, trimmed_checkpoint):
    def build(**changes):
        tuned = replace(recipe, fine_tuning=replace(recipe.fine_tuning, **changes))
        options = FineTuningOptions(start=trimmed_checkpoint, size="full")
        refinement = make_refinement(tuned, options)
        entry = replace(tuned.network("full"), schedule=refinement.schedule)
        return refinement.make_fitter(entry, material)

    return build


def batch(seed=0):
    draw = torch.Generator().manual_seed(seed)
    planes = torch.rand(2, 6, 64, 64, generator=draw)
    target = torch.rand(2, 3, 64, 64, generator=draw)
    return Batch(inputs=LAYOUT.by_name(planes), target=target, weight=torch.ones(2, 3))


def test_discriminators_learn_to_tell_truth_from_output(make):
    fitter = make(discriminator_rate=1e-3)
    losses = []
    for step in range(12):
        fitter.fit(batch(), step, 0.0)
        losses.append(fitter.notes()["discriminator_local"])
    assert losses[0] == pytest.approx(1, abs=0.5)
    assert 0 < losses[-1] < 0.8 * losses[0]


def test_generator_alone_follows_its_content_loss(make):
    fitter = make(global_weight=0.0, local_weight=0.0)
    losses = [fitter.fit(batch(), step, 0.0) for step in range(12)]
    assert losses[-1] < losses[0]


def test_scores_of_the_generator_do_not_move_the_discriminators(make):
    fitter = make(discriminator_rate=1e-12)
    opponents = fitter.objective.states["opponents"].networks
    assert set(opponents) == {"global", "local"}
    before = {n: p.clone() for n, p in opponents.named_parameters()}
    fitter.fit(batch(), 0, 0.0)
    for name, parameter in opponents.named_parameters():
        assert torch.allclose(parameter, before[name], atol=1e-9)


def test_real_pairs_replace_their_share_of_a_batch_by_the_step_alone():
    planes = np.full((3, 6, 64, 64), 0.25, dtype=np.float16)
    pairs = PairSamples(
        planes=planes, targets=planes[:, :3], weights=np.ones((3, 3), np.float32), alignments={}
    )
    mixed = pairs.mixer(0.5, seed=1)(batch(), 7)
    assert (mixed.planes[0] == 0.25).all()
    assert torch.equal(mixed.planes[1], batch().planes[1])
    # of one patch in four, half a patch of a batch of two is one in every other step
    seldom = [pairs.mixer(0.25, seed=1)(batch(), step) for step in range(200)]
    assert 80 < sum(bool((m.planes[0] == 0.25).all()) for m in seldom) < 120
    assert all(torch.equal(m.planes[1], batch().planes[1]) for m in seldom)


def test_recipe_table_is_checked():
    minimal = tomllib.loads(RECIPE)
    with pytest.raises(ContractError, match="fine_tuning must be a table"):
        to_recipe({"fine_tuning": 3, **minimal})
    with pytest.raises(ContractError, match="fine_tuning: unknown key 'sigma'"):
        to_recipe({"fine_tuning": {"sigma": 1.0}, **minimal})
    with pytest.raises(ContractError, match="weights >= 0"):
        to_recipe({"fine_tuning": {"pixel_weight": -1.0}, **minimal})
    with pytest.raises(ContractError, match="layers, width"):
        to_recipe({"fine_tuning": {"global_layers": 0}, **minimal})
