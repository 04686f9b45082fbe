"""The tiny camera of the training tests with the generator of chapter 3, by every loss."""

import cv2
import numpy as np
import pytest

from camkit.models_def.kinds.bayer import validation
from tests.bayer_recipe import RECIPE, bank, material, recipe  # noqa: F401
from tests.one_thread import one_thread  # noqa: F401

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


@pytest.fixture(scope="package", autouse=True)
def one_picture_to_validate_on():
    """Ten validation cases instead of eighty."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(validation, "PROCEDURAL_PICTURES", 1)
        yield


@pytest.fixture(scope="session")
def recipe_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("recipe") / "tiny.toml"
    path.write_text(RECIPE + NETWORKS, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def sharp_folder(tmp_path_factory):
    """Two pictures, one light and one dark."""
    folder = tmp_path_factory.mktemp("sharp")
    rng = np.random.default_rng(1)
    for name, top in (("light", 255), ("dark", 60)):
        picture = rng.integers(0, top, (48, 64, 3), dtype=np.uint8)
        cv2.imwrite(str(folder / f"{name}.png"), picture)
    return folder
