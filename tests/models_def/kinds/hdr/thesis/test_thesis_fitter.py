"""Each role is fitted by its own losses, through the trainer, with weights of VGG-19 or a word."""

import json
from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.coded_samples import PORTS, layout_of
from camkit.models_def.kinds.hdr.thesis.thesis_fitter import FITTING, ThesisLoss, thesis_fitter
from camkit.models_def.networks.vgg import VggLevels
from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.models_def.training.fitting import FitRequest
from camkit.models_def.training.log import read_log
from camkit.models_def.training.recipe import NetworkRecipe, ScheduleRecipe
from camkit.models_def.training.sample import Batch
from camkit.models_def.training.trainer import TrainOptions, train
from tests.models_def.kinds.hdr.thesis.conftest import NETWORKS, small_text

SCHEDULE = ScheduleRecipe(
    steps=4, batch=2, patch_px=32, precision="float32", learning_rate=3e-3, warmup_steps=1
)


def entry_of(role, **schedule):
    name, config = NETWORKS[role]
    return NetworkRecipe(network=name, config=config, schedule=replace(SCHEDULE, **schedule))


def request_of(recipe, role, **changes):
    return FitRequest(**({"recipe": recipe, "role": role, "entry": entry_of(role)} | changes))


def batch_of(recipe, role):
    torch.manual_seed(0)
    layout = layout_of(recipe, role)
    planes = torch.rand(2, layout.input_channels, 32, 32)
    target = torch.rand(2, layout.output_channels, 32, 32) * (1 if role == "split" else 3)
    return Batch(inputs=layout.by_name(planes), target=target, weight=torch.ones(target.shape[:2]))


@pytest.mark.parametrize(
    ("role", "terms"),
    [
        ("split", {"clean", "exclusion", "streaks"}),
        ("highlight", {"lights"}),
        ("fusion", {"fused"}),
        ("whole", {"clean", "exclusion", "lights", "fused"}),
    ],
)
def test_a_role_has_its_terms_and_its_loss_falls(small_recipe, role, terms):
    recipe = small_recipe(exclusion_from=0.0)
    fitter, batch = thesis_fitter(request_of(recipe, role)), batch_of(recipe, role)
    losses = [fitter.fit(batch, step, 0.0) for step in range(12)]
    assert losses[-1] < losses[0]
    assert set(fitter.notes()) == terms
    assert fitter.notes() == {}


def test_the_loss_is_the_sum_of_its_weighted_terms(small_recipe):
    recipe = small_recipe(
        perceptual_weight=2.0, exclusion_weight=3.0, exclusion_from=0.5, streak_weight=0.25
    )
    for progress, factor in ((0.0, 0.0), (0.6, 3.0)):
        fitter = thesis_fitter(request_of(recipe, "split"))
        loss = fitter.fit(batch_of(recipe, "split"), 0, progress)
        terms = fitter.notes()
        wanted = 2 * terms["clean"] + factor * terms["exclusion"] + 0.25 * terms["streaks"]
        assert loss == pytest.approx(wanted, rel=1e-5)


def test_against_glare_eq_5_9_stands_alone(small_recipe):
    recipe = small_recipe(optics="glare", streak_weight=0.0)
    fitter = thesis_fitter(request_of(recipe, "split"))
    fitter.fit(batch_of(recipe, "split"), 0, 1.0)
    assert set(fitter.notes()) == {"clean", "exclusion"}


def test_vgg_is_not_moved_by_training(small_recipe):
    recipe = small_recipe()
    fitter = thesis_fitter(request_of(recipe, "whole"))
    before = {k: v.clone() for k, v in fitter.weights().items()}
    fitter.fit(batch_of(recipe, "whole"), 0, 0.0)
    moved = {k for k, v in fitter.weights().items() if not torch.equal(v, before[k])}
    assert not any(".vgg." in name for name in moved)
    assert {name.split(".")[1] for name in moved} == {"splitting", "highlight", "fusion"}


@pytest.mark.parametrize(
    ("role", "changes", "thesis", "named"),
    [
        ("split", {}, {"random_vgg": False}, r"vgg \(a file .*random_vgg = true in \[thesis\]"),
        ("split", {"entry": entry_of("fusion")}, {}, "split is thesis_split; got thesis_fusion"),
        ("fusion", {"entry": entry_of("fusion", precision="bfloat16")}, {}, 'float32" with the'),
    ],
)
def test_what_cannot_be_fitted_is_refused(small_recipe, role, changes, thesis, named):
    with pytest.raises(ContractError, match=named):
        FITTING.fitting(request_of(small_recipe(**thesis), role, **changes))


def test_other_networks_have_the_fitter_of_the_house(small_recipe):
    lean = NetworkRecipe(network="lean_s", config={"in_channels": 3})
    for role in ("whole", "highlights"):
        assert FITTING.fitting(FitRequest(recipe=small_recipe(), role=role, entry=lean)) is None
    fusion = FITTING.fitting(request_of(small_recipe(random_vgg=False), "fusion"))
    assert fusion.credit == ""


def test_weights_of_a_file_go_into_network_average_and_losses(small_recipe, tmp_path):
    path, state = tmp_path / "vgg.pth", VggLevels(widths=(2,) * 5).state_dict()
    torch.save({name: tensor + 1 for name, tensor in state.items()}, path)
    request = request_of(small_recipe(random_vgg=False), "split", vgg=path)
    fitting = FITTING.fitting(request)
    assert "with VGG-19 of vgg.pth (sha256 " in fitting.credit
    fitter = fitting.make(None)
    for network in (fitter.network, fitter.averaged):
        found = network.body.vgg.state_dict()
        assert all(torch.equal(found[name], tensor + 1) for name, tensor in state.items())
    features = ThesisLoss(request).features.state_dict()
    assert all(torch.equal(features[name], state[name] + 1) for name in features)


@pytest.fixture
def recipe_path(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(small_text(), encoding="utf-8")
    return path


@pytest.mark.parametrize("role", PORTS)
def test_the_trainer_trains_a_role_and_its_checkpoint_gives_the_network(
    tmp_path, recipe_path, streaks, role
):
    options = TrainOptions(out_dir=tmp_path, role=role, size="S", workers=0)
    result = train(recipe_path, options, material=streaks)
    assert result.steps == 4
    saved = read_checkpoint(result.checkpoint)
    assert saved.role == role
    assert ("VGG-19 with random weights" in saved.training_data) == (role != "fusion")
    network = load_network(saved)
    assert torch.isfinite(network(torch.rand(1, 6 if role == "fusion" else 3, 32, 32))).all()
    assert json.dumps(read_log(result.log), allow_nan=False)


def test_a_resumed_run_ends_in_the_same_bits(tmp_path, recipe_path, streaks):
    options = TrainOptions(out_dir=tmp_path / "one", role="split", size="S", workers=0)
    whole = train(recipe_path, options, material=streaks)
    half = replace(options, out_dir=tmp_path / "two", stop_at_step=2)
    train(recipe_path, half, material=streaks)
    resumed = train(recipe_path, replace(half, stop_at_step=None, resume=True), material=streaks)
    one, two = (read_checkpoint(result.checkpoint).weights for result in (whole, resumed))
    assert all(torch.equal(one[name], two[name]) for name in one)


def test_vgg_is_refused_before_any_work_where_no_loss_looks_at_it(tmp_path, recipe_path, streaks):
    options = TrainOptions(
        out_dir=tmp_path / "out", role="whole", size="M", workers=0, vgg=tmp_path / "vgg.pth"
    )
    with pytest.raises(ContractError, match="lean_s in the role 'whole' does not look at VGG-19"):
        train(recipe_path, options, material=streaks)
    assert not options.out_dir.exists()
    result = train(recipe_path, replace(options, vgg=None), material=streaks)
    assert "VGG" not in read_checkpoint(result.checkpoint).training_data
