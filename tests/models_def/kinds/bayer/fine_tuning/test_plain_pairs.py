"""Training on real pairs by the loss of the schedule: no discriminator, no features."""

import json

import numpy as np
import pytest
import torch

import camkit
from camkit.cli.app import run
from camkit.models_def.kinds.bayer import fitting
from camkit.models_def.kinds.bayer.fine_tuning.pairs import read_pairs
from camkit.models_def.kinds.bayer.training import BayerTraining
from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.models_def.training.losses import patch_errors
from camkit.models_def.training.trainer import TrainOptions, train
from tests.bayer_recipe import one_picture_to_validate_on, planes_text  # noqa: F401
from tests.developed_pair import write_developed_pair

FINE_TUNING = """
[fine_tuning]
pair_share = 1.0
pair_samples = 4
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory, planes_recipe):
    home = tmp_path_factory.mktemp("developed")
    write_developed_pair(home, planes_recipe.sensor)
    return home


@pytest.fixture(scope="module")
def pairs_recipe_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("recipe") / "planes.toml"
    path.write_text(planes_text() + FINE_TUNING, encoding="utf-8")
    return path


@pytest.fixture(autouse=True)
def no_tracing(monkeypatch, material):
    """Train behind Gaussians, which nobody has to trace."""
    monkeypatch.setattr(fitting, "trace_recipe_distortion", lambda *_: None)
    monkeypatch.setattr(BayerTraining, "prepare", lambda *_: material)


def test_training_on_pairs_lowers_their_error(
    tmp_path, pairs_recipe_path, folder, material, planes_recipe
):
    options = TrainOptions(out_dir=tmp_path, size="M", pairs=folder, workers=0, steps=120)
    saved = read_checkpoint(train(pairs_recipe_path, options).checkpoint)
    assert saved.training_data.endswith(f"; a share of 1 of real pairs of {folder.name}")
    assert saved.best == {}  # simulated captures do not choose what real ones teach
    batch = read_pairs(folder, planes_recipe, material.bank, None, seed=9).draw_batch(
        np.random.default_rng(1), 16, 48
    )
    network = load_network(saved)
    with torch.no_grad():
        restored = network(batch.planes)
    wiener, trained = (
        patch_errors(picture, batch.target, batch.weight).mean()
        for picture in (batch.inputs["wiener"], restored)
    )
    assert trained < 0.9 * wiener


def test_a_run_on_pairs_goes_on_to_the_last_bit(tmp_path, pairs_recipe_path, folder):
    given = {"size": "S", "pairs": folder, "workers": 0, "steps": 6}
    whole = train(pairs_recipe_path, TrainOptions(out_dir=tmp_path / "a", **given))
    halted = TrainOptions(out_dir=tmp_path / "b", stop_at_step=3, **given)
    train(pairs_recipe_path, halted)
    resumed = train(pairs_recipe_path, TrainOptions(out_dir=tmp_path / "b", resume=True, **given))
    one, two = (read_checkpoint(result.checkpoint) for result in (whole, resumed))
    assert all(torch.equal(one.weights[name], two.weights[name]) for name in one.weights)


def test_the_command_and_python_train_on_pairs(tmp_path, pairs_recipe_path, folder, capsys):
    ask = ["train", pairs_recipe_path, "--size", "S", "--pairs", folder, "--steps", 3]
    ask += ["--workers", 0, "--out-dir", tmp_path / "shell", "--json"]
    assert run([str(part) for part in ask]) == 0
    told = json.loads(capsys.readouterr().out)
    result = camkit.train(
        pairs_recipe_path, tmp_path / "python", size="S", pairs=folder, steps=3, workers=0
    )
    assert (told["steps"], result.steps) == (3, 3)
    one, two = (
        read_checkpoint(path) for path in (tmp_path / "shell" / "tiny_S.pt", result.checkpoint)
    )
    assert all(torch.equal(one.weights[name], two.weights[name]) for name in one.weights)


def test_a_wrong_folder_is_told_in_one_line(tmp_path, pairs_recipe_path, capsys):
    ask = ["train", pairs_recipe_path, "--size", "S", "--pairs", tmp_path / "nowhere"]
    assert run([str(part) for part in [*ask, "--out-dir", tmp_path]]) == 2
    assert "real pairs need" in capsys.readouterr().err
    ask = ["train", pairs_recipe_path, "--size", "S", "--pairs", tmp_path, "--vgg", "vgg19.pth"]
    assert run([str(part) for part in [*ask, "--out-dir", tmp_path]]) == 2
    assert "does not look at VGG-19: leave --vgg away" in capsys.readouterr().err
