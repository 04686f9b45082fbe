"""The tables of arrays of single photons made so small that all of them take seconds."""

import tomllib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from camkit.models_def.kinds.spad import validation
from camkit.models_def.kinds.spad.networks import build_spad_network
from camkit.models_def.kinds.spad.plate_psf import write_plate_psf
from camkit.models_def.training.kind import to_recipe
from camkit.scenes import procedural_scene
from tests.spad_bundle import leaning_kernel
from tests.spad_checkpoint import write_untrained
from tools.tables import equal_training
from tools.tables.spad import array_table, array_training
from tools.tables.table_rows import chosen_trainings

RECIPE = """
name = "spad-sr"
kind = "spad"

[sensor]
type = "spad"
width_px = 16
height_px = 12
pixel_pitch_um = 150.0
sub_pixels = 4
phase = 2

[sampling]
mode = "learned"
psf = "plate.safetensors"

[data]
procedural_scenes = 2
scene_px = 256
sample_px = 16
first_samples = 4
pool_samples = 40
steps_per_sample = 2

[schedule]
batch = 2
patch_px = 8
loss = "mse"

[networks.S]
network = "sub_pixel_s"
config = { width = 16, blocks = 1 }

[networks.M]
network = "sub_pixel_m"
config = { width = 16, blocks = 1 }

[networks.srcnn]
network = "srcnn"
config = { in_channels = 2, kernels_px = [3, 1, 3] }
"""
SIGMA = 1.7
Rig = Callable[..., str]


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Callable[..., str]) -> Rig:
    """Give the command of the table, with a small recipe."""
    recipes = tmp_path / "recipes"
    recipes.mkdir()
    (recipes / array_training.RECIPE).write_text(RECIPE, encoding="utf-8")
    write_plate_psf(recipes / "plate.safetensors", leaning_kernel())
    monkeypatch.setattr(array_training, "RECIPES", recipes)
    for module in (array_training, array_table):
        monkeypatch.setattr(module, "level_sigma", lambda _: SIGMA)
    monkeypatch.setattr(validation, "CROPS", 1)
    monkeypatch.setattr(validation, "CROP_PX", 96)
    return lambda *words: command("spad", *words)


def write_run(runs: Path, name: str) -> None:
    """Write what a training leaves, of a network that was not trained at all."""
    (run,) = chosen_trainings(array_table.ROWS, [name])
    text = array_training.recipe_text(run, None)
    recipe = to_recipe(tomllib.loads(text))
    chosen = recipe.network(run.row.size, array_training.ROLE)
    torch.manual_seed(run.seed)
    network = build_spad_network(chosen.network, **chosen.config)
    with torch.no_grad():
        # a new one is the same whatever its seed
        for values in network.parameters():
            values.add_(torch.randn_like(values), alpha=0.002)
    folder = runs / name
    folder.mkdir(parents=True)
    (folder / equal_training.RECIPE).write_text(text, encoding="utf-8")
    (folder / equal_training.DONE_FILE).write_text('{"cpu_minutes": 15}', encoding="utf-8")
    write_untrained(
        equal_training.checkpoint_of(runs, run),
        text,
        role=array_training.ROLE,
        size=run.row.size,
        network=chosen.network,
        config=dict(chosen.config),
        training_data="nothing",
        weights=network.state_dict(),
    )


def write_sets(folder: Path) -> Path:
    """Write a picture of Set5 and two of Set14."""
    for name, seeds in {"set5": (1,), "set14": (2, 3)}.items():
        (folder / name).mkdir(parents=True)
        for seed in seeds:
            scene = np.clip(procedural_scene(seed, 50, 61), 0, 1) ** (1 / 2.4)
            values = np.rint(255 * scene[::-1].transpose(1, 2, 0)).astype(np.uint8)
            assert cv2.imwrite(str(folder / name / f"{seed}.png"), values)
    return folder
