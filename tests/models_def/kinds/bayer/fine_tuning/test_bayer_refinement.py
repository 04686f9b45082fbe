"""Fine-tuning as a run: it goes on exactly, says what it learned from, and can be exported."""

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.fine_tuning.bayer_refinement import REFINING, make_refinement
from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.models_def.training.log import read_log
from camkit.models_def.training.refinement import FineTuningOptions, refining_kind
from camkit.models_def.training.trainer import TrainOptions, train


def run(folder, recipe_path, recipe, material, start, **changes):
    given = {"out_dir": folder, "size": "full", "workers": 0} | changes
    refinement = make_refinement(
        recipe, FineTuningOptions(start=start, size=given["size"]), distort=lambda *_: None
    )
    return train(recipe_path, TrainOptions(**given), material=material, refinement=refinement)


@pytest.fixture(scope="module")
def whole(tmp_path_factory, recipe_path, recipe, material, trimmed_checkpoint):
    folder = tmp_path_factory.mktemp("fine_tuning")
    return run(folder, recipe_path, recipe, material, trimmed_checkpoint)


def test_resumed_run_equals_an_uninterrupted_one_to_the_last_bit(
    tmp_path, recipe_path, recipe, material, trimmed_checkpoint, whole
):
    given = (tmp_path, recipe_path, recipe, material, trimmed_checkpoint)
    run(*given, stop_at_step=3)
    resumed = run(*given, resume=True)
    one, two = read_checkpoint(whole.checkpoint), read_checkpoint(resumed.checkpoint)
    assert (one.step, two.step) == (6, 6)
    for a, b in (
        (one.weights, two.weights),
        (one.average, two.average),
        tuple(saved.optimizer["opponents"]["weights"] for saved in (one, two)),
    ):
        assert all(torch.equal(a[name], b[name]) for name in a)


def test_checkpoint_has_a_name_of_its_own_and_loads_like_any_network(whole):
    assert whole.checkpoint.name == "tiny_full_fine_tuned.pt"
    saved = read_checkpoint(whole.checkpoint)
    assert (saved.network, saved.size) == ("full_unet", "full")
    network = load_network(saved)
    assert network(torch.rand(1, 6, 64, 128)).shape == (1, 3, 64, 128)
    # tests/parity exports the same network.
    assert not any(isinstance(m, torch.nn.InstanceNorm2d) for m in network.modules())


def test_card_says_that_no_vgg_was_used(whole):
    told = read_checkpoint(whole.checkpoint).training_data
    assert told.endswith("fine-tuned against two discriminators, without VGG-19")


def test_another_network_is_no_start(tmp_path, recipe_path, recipe, material, trimmed_checkpoint):
    given = (tmp_path, recipe_path, recipe, material, trimmed_checkpoint)
    with pytest.raises(ContractError, match="holds another network than the recipe's"):
        run(*given, size="S")


def test_a_refinement_takes_no_second_start(
    tmp_path, recipe_path, recipe, material, trimmed_checkpoint
):
    refinement = make_refinement(recipe, FineTuningOptions(start=trimmed_checkpoint, size="full"))
    options = TrainOptions(out_dir=tmp_path, size="full", start=trimmed_checkpoint)
    with pytest.raises(ContractError, match="refinement has its own start"):
        train(recipe_path, options, material=material, refinement=refinement)


def test_log_holds_every_term(whole):
    assert read_log(whole.log)[-1]["valid_db"] == pytest.approx(whole.valid_db)


def test_the_kind_is_asked_for_its_fine_tuning():
    assert refining_kind("bayer") is REFINING
