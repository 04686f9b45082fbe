"""The tiny camera behind a mosaic with the generator of chapter 3, by every loss; to import."""

import pytest

from tests.bayer_recipe import RECIPE, write_recipe

NETWORKS = """
[schedule.critic]
layers = 2
width = 4
steps = 2

[networks.adversarial]
network = "normed_unet"
config = { width = 4, stages = 3 }
schedule = { loss = "adversarial", steps = 6, precision = "float32" }

[networks.gram]
network = "normed_unet"
config = { width = 4, stages = 3 }

[networks.gram.schedule]
loss = "content"
steps = 3
precision = "float32"
content = { l1_weight = 0.0, gram_weight = 1.0 }

[networks.l1]
network = "normed_unet"
config = { width = 4, stages = 3 }
schedule = { loss = "l1", steps = 3, precision = "float32" }
"""
NORMED_RECIPE = RECIPE + NETWORKS


@pytest.fixture(scope="session")
def recipe_path(tmp_path_factory):
    return write_recipe(tmp_path_factory, NETWORKS)
