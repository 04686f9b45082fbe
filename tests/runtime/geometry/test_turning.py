import numpy as np
import pytest
from PIL import Image, ImageOps

from camkit.runtime.geometry.turning import turn, turn_back


@pytest.mark.parametrize("orientation", range(1, 9))
def test_turning_agrees_with_a_viewer(orientation: int) -> None:
    pixels = np.random.default_rng(0).integers(0, 255, (4, 5, 3), dtype=np.uint8)
    image = Image.fromarray(pixels)
    image.getexif()[274] = orientation
    shown = np.asarray(ImageOps.exif_transpose(image))
    np.testing.assert_array_equal(
        turn(pixels.transpose(2, 0, 1), orientation), shown.transpose(2, 0, 1)
    )


@pytest.mark.parametrize("orientation", range(1, 9))
def test_turning_back_undoes_turning(orientation: int) -> None:
    planes = np.arange(60).reshape(3, 4, 5)
    np.testing.assert_array_equal(turn_back(turn(planes, orientation), orientation), planes)
