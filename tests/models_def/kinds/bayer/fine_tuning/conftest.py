"""The tiny camera of the training tests with tables for fine-tuning."""

import pytest

from camkit.models_def.training.trainer import TrainOptions, train
from tests.bayer_recipe import (
    bank,  # noqa: F401
    material,  # noqa: F401
    one_picture_to_validate_on,  # noqa: F401
    recipe,  # noqa: F401
    write_recipe,
)

FINE_TUNING = """
[networks.trimmed]
network = "trimmed_unet"
config = { widths = [4, 4, 8] }
schedule = { steps = 4, precision = "float32" }

[networks.full]
network = "full_unet"
config = { widths = [4, 4, 8, 8, 8, 8, 8] }

[fine_tuning]
discriminator_width = 4
pair_samples = 4
schedule = { steps = 6, batch = 2, patch_px = 64, warmup_steps = 2 }
"""


@pytest.fixture(scope="session")
def recipe_path(tmp_path_factory):
    return write_recipe(tmp_path_factory, FINE_TUNING)


@pytest.fixture(scope="session")
def trimmed_checkpoint(tmp_path_factory, recipe_path, material):  # noqa: F811
    """Four steps of the trimmed U-Net."""
    options = TrainOptions(
        out_dir=tmp_path_factory.mktemp("trimmed"), size="trimmed", workers=0, threads=1
    )
    return train(recipe_path, options, material=material).checkpoint
