"""The tiny camera of the training tests with the generator of chapter 3, by every loss."""

import cv2
import numpy as np
import pytest

from tests.bayer_recipe import bank, material, one_picture_to_validate_on, recipe  # noqa: F401
from tests.normed_recipe import recipe_path  # noqa: F401
from tests.one_thread import one_thread  # noqa: F401


@pytest.fixture(scope="session")
def sharp_folder(tmp_path_factory):
    """Two pictures, one light and one dark."""
    folder = tmp_path_factory.mktemp("sharp")
    rng = np.random.default_rng(1)
    for name, top in (("light", 255), ("dark", 60)):
        picture = rng.integers(0, top, (48, 64, 3), dtype=np.uint8)
        cv2.imwrite(str(folder / f"{name}.png"), picture)
    return folder
