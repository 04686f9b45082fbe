"""A camera with barrel distortion and its centre off the middle, and photographs it took."""

from pathlib import Path

import pytest

from camkit.calibration.geometry.camera_model import MODELS, Camera
from tests.camkit.calibration.geometry.board_factory import (
    Shot,
    camera_of,
    poses_around,
    write_photographs,
)

SHOT = Shot()


@pytest.fixture(scope="package")
def barrel() -> Camera:
    return camera_of(MODELS[2], 340, (207.5, 141.0), -0.25, 0.06)


@pytest.fixture(scope="package")
def photographs(barrel: Camera, tmp_path_factory) -> list[Path]:
    """Ten 16-bit pictures."""
    folder = tmp_path_factory.mktemp("board")
    return write_photographs(folder, barrel, poses_around(barrel, SHOT.size, 10, seed=1), SHOT)
