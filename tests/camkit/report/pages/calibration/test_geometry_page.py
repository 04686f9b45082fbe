"""The page of a camera's geometry."""

import re

import numpy as np
import pytest

from camkit.calibration.geometry.camera_model import MODELS
from camkit.calibration.geometry.geometry import Geometry, calibrate_geometry
from camkit.report.pages.calibration.geometry_page import LONGEST, enlargement, geometry_html
from tests.camkit.calibration.geometry.board_factory import (
    BOARD,
    Shot,
    camera_of,
    poses_around,
    write_photographs,
)


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> Geometry:
    camera, shot = camera_of(MODELS[2], 340, (207.5, 141.0), -0.25, 0.06), Shot(fine=2)
    poses = poses_around(camera, shot.size, 6, seed=1)
    return calibrate_geometry(write_photographs(tmp_path_factory.mktemp("b"), camera, poses, shot), BOARD)  # noqa: E501 # fmt: skip


def test_the_page_shows_residuals_coverage_and_distortion(found: Geometry) -> None:
    page = geometry_html(found)
    captions = re.findall("<figcaption>(.*?)</figcaption>", page)
    assert captions == ["Residuals over the picture", "Held-out error", "Covered area", "Distortion along the radius"]  # noqa: E501 # fmt: skip
    assert page.count("data:image/png") == 4
    assert "do not use it" in page
    assert found.camera.model.name + " (taken)" in page
    assert all(view.path.name in page for view in found.views)


def test_pictures_are_the_same_from_run_to_run(found: Geometry) -> None:
    assert geometry_html(found) == geometry_html(found)


@pytest.mark.parametrize("longest", [1e-6, 0.02, 0.5, 30.0, 4000.0])
def test_residuals_are_enlarged_by_a_round_number_that_fits(longest: float) -> None:
    factor = enlargement(np.array([[[longest, 0.0]]]), (400, 300))
    assert str(factor).rstrip("0") in {"1", "2", "5"}
    assert factor * longest <= LONGEST * 400 or factor == 1
