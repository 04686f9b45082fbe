"""A single-photon camera so small that a step of its network takes no second."""

import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from camkit.models_def.kinds.spad.recipe import SpadRecipe, to_spad_recipe
from tests.changed_table import Table, changed_table

TINY = """
name = "tiny-spad"
kind = "spad"

[sensor]
type = "spad"
width_px = 64
height_px = 32
pixel_pitch_um = 150.0
fill_factor = 0.0314
sub_pixels = 4
phase = 2

[sampling]
mode = "gaussian"

[data]
procedural_scenes = 2
scene_px = 256
sample_px = 16
photons_min = 100.0
photons_max = 1e4
first_samples = 4
pool_samples = 40
steps_per_sample = 2

[schedule]
steps = 4
batch = 2
patch_px = 8
loss = "mse"

[networks.S]
network = "sub_pixel_s"
config = { width = 16, blocks = 1 }

[networks.plate.S]
network = "joint_sub_pixel_s"
config = { width = 16, blocks = 1 }
"""


@pytest.fixture(scope="session")
def tiny_text() -> str:
    return TINY


@pytest.fixture
def changed() -> Callable[..., Table]:
    """Give the table of the tiny recipe, changed as `changed_table` says."""
    return partial(changed_table, TINY)


@pytest.fixture(scope="session")
def tiny() -> SpadRecipe:
    return to_spad_recipe(tomllib.loads(TINY))


@pytest.fixture
def tiny_file(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.toml"
    path.write_text(TINY, encoding="utf-8")
    return path
