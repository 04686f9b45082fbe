"""Distortion along a radius: its polynomial, its folds, its end; and where the board was seen."""

import numpy as np
import pytest

from camkit.calibration.geometry.camera_model import MODELS, project
from camkit.calibration.geometry.coverage import coverage_of, seen_cells
from camkit.calibration.geometry.distortion_profile import fit_radial, profile_of
from camkit.errors import ContractError
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.distortion import check_distortion, distort_points, undistort_points
from tests.camkit.calibration.geometry.board_factory import camera_of

CENTRE = (200.0, 150.0)
CORNER_PX = 250.0
EXACT_PX = 1e-3


def test_the_polynomial_is_what_the_runtime_distorts_by() -> None:
    camera = camera_of(MODELS[3], 340, CENTRE, -0.2, 0.05, -0.01)
    fit = fit_radial(profile_of(camera, CORNER_PX), 250, CORNER_PX)
    assert fit.residual_px < EXACT_PX
    pixels = RadialDistortion(coefficients=np.array([fit.coefficients]), radius_mm=fit.radius_px)
    ideal = np.random.default_rng(0).uniform(-150, 150, (50, 2))
    rays = np.concatenate([ideal / camera.focal_px, np.ones((50, 1))], axis=1)
    seen = project(camera, np.zeros(6), rays)[0] - CENTRE
    np.testing.assert_allclose(distort_points(ideal, pixels, channel=0), seen, atol=EXACT_PX)
    np.testing.assert_allclose(undistort_points(seen, pixels, channel=0), ideal, atol=EXACT_PX)


@pytest.mark.parametrize(
    ("model", "numbers"),
    [(4, (0.03, -0.01, 0.004, -0.002)), (6, (0.1, 0.05, 0, 0, 0.01, 0.4, 0.03, 0.02))],
)
@pytest.mark.parametrize("covered_px", [120.0, 200.0])
def test_a_polynomial_never_folds_inside_the_picture(model, numbers, covered_px: float) -> None:
    profile = profile_of(camera_of(MODELS[model], 185, CENTRE, *numbers), covered_px)
    fit = fit_radial(profile, 250, CORNER_PX)
    check_distortion(
        RadialDistortion(coefficients=np.array([fit.coefficients]), radius_mm=250), CORNER_PX
    )
    assert fit.residual_px < 0.05 * covered_px


def test_a_profile_ends_where_it_folds() -> None:
    camera = camera_of(MODELS[1], 340, CENTRE, -0.5)
    # r (1 - r^2 / 2) grows to r = sqrt(2 / 3)
    assert profile_of(camera, 100).fold_px == pytest.approx(340 * np.sqrt(2 / 3) * 2 / 3, rel=1e-4)


def test_a_profile_ends_at_the_pole_of_a_rational_model() -> None:
    camera = camera_of(MODELS[6], 340, CENTRE, 0, 0, 0, 0, 0, -1.0, 0, 0)
    profile = profile_of(camera, 100)
    assert float(np.tan(profile.angles_rad[-1])) < 1


@pytest.mark.parametrize("model", [0, 4])
def test_ideal_radii_are_those_that_fall_there(model: int) -> None:
    camera = camera_of(MODELS[model], 185, CENTRE, *((0.03, -0.01, 0, 0) if model else ()))
    profile = profile_of(camera, 200)
    ideal = profile.ideal_px(np.array([0.0, 50, 200])) / 185
    rays = np.stack([ideal, 0 * ideal, 0 * ideal + 1], axis=1)
    seen = project(camera, np.zeros(6), rays)[0][:, 0] - CENTRE[0]
    np.testing.assert_allclose(seen, [0, 50, 200], atol=EXACT_PX)


def test_nothing_is_said_beyond_what_was_seen() -> None:
    profile = profile_of(camera_of(MODELS[1], 340, CENTRE, -0.1), 150)
    with pytest.raises(ContractError, match=r"known to 150\.0 px .* got 151\.0 px"):
        profile.ideal_px(np.array([10.0, 151.0]))


def test_a_radius_counts_as_seen_where_two_pictures_reach() -> None:
    views = np.array([[(200, 150), (210, 150)], [(200, 150), (230, 150)], [(200, 150), (300, 150)]])
    found = coverage_of(views.astype(float), CENTRE, (401, 301))
    assert found.radius_px == 30
    assert found.corner_px == pytest.approx(np.hypot(200, 150))
    assert not found.is_whole


def test_the_share_that_was_seen_is_that_of_the_hulls() -> None:
    half = np.array([[(0, 0), (199, 0), (0, 299), (199, 299)]] * 2, dtype=float)
    assert seen_cells(half, (400, 300)).mean() == pytest.approx(0.5, abs=0.02)
    assert coverage_of(half, CENTRE, (400, 300)).share == pytest.approx(0.5, abs=0.02)
