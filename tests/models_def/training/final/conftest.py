"""The tiny camera of the training tests with tables for the final stage."""

import pytest

from camkit.models_def.training import validation
from camkit.models_def.training.recipe import read_recipe
from camkit.models_def.training.samples import corner_height_mm
from camkit.models_def.training.trainer import TrainOptions, train
from tests.gaussian_bank import gaussian_bank
from tests.models_def.training.conftest import RECIPE, one_thread  # noqa: F401

FINAL = """
[networks.trimmed]
network = "trimmed_unet"
config = { widths = [4, 4, 8] }
schedule = { steps = 4, precision = "float32" }

[networks.full]
network = "full_unet"
config = { widths = [4, 4, 8, 8, 8, 8, 8] }

[final]
discriminator_width = 4
pair_samples = 4
schedule = { steps = 6, batch = 2, patch_px = 64, warmup_steps = 2 }
"""


@pytest.fixture(scope="package", autouse=True)
def one_picture_to_validate_on():
    """Ten validation cases instead of eighty."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(validation, "PROCEDURAL_PICTURES", 1)
        yield


@pytest.fixture(scope="session")
def final_recipe_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("final_recipe") / "tiny.toml"
    path.write_text(RECIPE + FINAL, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def final_recipe(final_recipe_path):
    return read_recipe(final_recipe_path)


@pytest.fixture(scope="session")
def final_bank(final_recipe):
    height = corner_height_mm(final_recipe)
    return gaussian_bank(sensor_height_mm=height, axis_px=0.9, corner_px=1.8)


@pytest.fixture(scope="session")
def trimmed_checkpoint(tmp_path_factory, final_recipe_path, final_bank):
    """Four steps of the trimmed U-Net."""
    options = TrainOptions(
        out_dir=tmp_path_factory.mktemp("trimmed"), size="trimmed", workers=0, threads=1
    )
    return train(final_recipe_path, options, bank=final_bank).checkpoint
