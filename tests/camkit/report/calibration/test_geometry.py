"""The page of a camera's geometry."""

import numpy as np
import pytest

from camkit.calibration.geometry.camera_model import MODELS
from camkit.calibration.geometry.geometry import Geometry, calibrate_geometry
from camkit.report.calibration.geometry import geometry_sections
from camkit.report.calibration.geometry_charts import LONGEST, enlargement
from camkit.report.calibration.page import to_html
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
    sections = geometry_sections(found)
    pictures = [name for section in sections for name in section.pictures]
    assert pictures == ["Residuals over the picture", "Held-out error", "Covered area", "Distortion along the radius"]  # noqa: E501 # fmt: skip
    page = to_html("x", sections)
    assert page.count("data:image/png") == 4
    assert "do not use it" in page
    assert found.camera.model.name + " (taken)" in page
    assert all(view.path.name in page for view in found.views)


def test_pictures_are_the_same_from_run_to_run(found: Geometry) -> None:
    one, other = (
        [png for section in geometry_sections(found) for png in section.pictures.values()]
        for _ in range(2)
    )
    assert one == other


@pytest.mark.parametrize("longest", [1e-6, 0.02, 0.5, 30.0, 4000.0])
def test_residuals_are_enlarged_by_a_round_number_that_fits(longest: float) -> None:
    factor = enlargement(np.array([[[longest, 0.0]]]), (400, 300))
    assert str(factor).rstrip("0") in {"1", "2", "5"}
    assert factor * longest <= LONGEST * 400 or factor == 1
