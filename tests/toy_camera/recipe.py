"""What a person would write to train the toy camera, and the streaks that were measured of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from camkit.bundle.psf_file import write_psf
from camkit.bundle.sensor import PlanesSensor
from camkit.errors import ContractError
from camkit.models_def.optics.measured import measured_psf
from camkit.models_def.toml_table import section
from camkit.models_def.training.recipe import DataRecipe, Recipe, common_tables
from tests.psf_factory import streak_kernel

ROLES = ("denoise", "upscale")
PITCH_UM = 4.0
STREAKS = "streaks.safetensors"
TURN_DEG = 25.0
LENGTHS_PX = ((5, 6), (7, 8))
RECIPE = """
name = "toy"
kind = "toy"

[sensor]
width_px = 320
height_px = 256
pixel_pitch_um = 4.0
channels = ["Y"]
black_level = 64.0
white_level = 4095.0
full_well_e = 9000.0
noise = [
    { iso = 100.0, gain_e_per_dn = 2.2327, read_noise_e = 3.0 },
    { iso = 800.0, gain_e_per_dn = 0.27909, read_noise_e = 2.0 },
]

[sensor.channel_response]
wavelengths_um = [0.45, 0.55, 0.65]
response = [[0.5, 1.0, 0.5]]
source = "made up for tests"

[optics]
psf = "psf.safetensors"

[data]
procedural_scenes = 3
scene_px = 256
sample_px = 48
pool_samples = 64
first_samples = 12
steps_per_sample = 4

[schedule]
steps = 160
batch = 4
patch_px = 32
warmup_steps = 5
learning_rate = 4e-3
precision = "float32"

[networks.denoise.S]
network = "denoiser"

[networks.upscale.S]
network = "upscaler"
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class OpticsRecipe:
    """The frozen PSF to train behind, relative to the recipe."""

    psf: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ToyRecipe(Recipe):
    """The common tables, and one of its own."""

    sensor: PlanesSensor
    optics: OpticsRecipe


def to_toy_recipe(table: Mapping[str, Any]) -> ToyRecipe:
    """Check the tables of a recipe.

    Raises:
        ContractError: Naming the key.
    """
    common = common_tables(table, kind_keys=("optics",), roles=ROLES)
    if not isinstance(common.sensor, PlanesSensor) or common.sensor.channels != ("Y",):
        raise ContractError('the toy camera is grey: sensor.channels must be ["Y"]')
    return ToyRecipe(
        name=common.name,
        kind=common.kind,
        sensor=common.sensor,
        networks=common.networks,
        data=section("data", DataRecipe, table.get("data", {})),
        optics=section("optics", OpticsRecipe, table.get("optics", {})),
    )


def write_toy(folder: Path) -> Path:
    """Write the recipe, and what was measured of the optics beside it; give the recipe's path."""
    kernels = np.array(
        [[[streak_kernel(TURN_DEG, length)] for length in row] for row in LENGTHS_PX]
    )
    sides_mm = np.array([320, 256]) * PITCH_UM / 1000 / 2
    grid_mm = (np.array([-1.0, 1.0]) * sides_mm[0], np.array([-1.0, 1.0]) * sides_mm[1])
    measured = measured_psf(
        kernels, pixel_pitch_um=PITCH_UM, wavelengths_um=(0.55,), grid_mm=grid_mm
    )
    write_psf(folder / STREAKS, measured)
    path = folder / "toy.toml"
    path.write_text(RECIPE, encoding="utf-8")
    return path
