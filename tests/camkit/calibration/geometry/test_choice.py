"""Fits to corners that are known exactly, models chosen, and views that contradict the others."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.calibration.geometry.adjustment import adjust, rms
from camkit.calibration.geometry.camera_model import MODELS, Camera, FloatGrid, project
from camkit.calibration.geometry.choice import judge, judge_all, simplest
from camkit.calibration.geometry.start import fit_models
from tests.camkit.calibration.geometry.board_factory import BOARD, camera_of, poses_around

SIZE = (400, 300)
EXACT_PX = 1e-4
NOISE_PX = 0.1
POINTS = BOARD.points


def _corners(camera: Camera, count: int = 10, noise: float = 0.0, seed: int = 0) -> FloatGrid:
    poses = poses_around(camera, SIZE, count, seed=1)
    exact = np.stack([project(camera, pose, POINTS)[0] for pose in poses])
    return exact + np.random.default_rng(seed).normal(0, noise / np.sqrt(2), exact.shape)


TRUTHS = {
    "pinhole": (700, (190.0, 160.0)),
    "radial_1": (340, (190.0, 160.0), -0.2),
    "radial_2": (340, (207.5, 141.0), -0.25, 0.06),
    "fisheye": (185, (204.5, 153.0), 0.03, -0.01, 0.004, -0.002),
    "brown": (340, (207.5, 141.0), -0.25, 0.06, 0.003, -0.004, 0.01),
}


@pytest.mark.parametrize("name", TRUTHS)
def test_exact_corners_give_the_camera_back(name: str) -> None:
    model = next(model for model in MODELS if model.name == name)
    focal, centre, *rest = TRUTHS[name]
    camera = camera_of(model, focal, centre, *rest)
    fits = fit_models(_corners(camera), POINTS, SIZE)
    fit = next(fit for fit in fits if fit.camera.model is model)
    assert fit.rms_px < EXACT_PX
    np.testing.assert_allclose(fit.camera.intrinsics, camera.intrinsics, atol=0.01)


def test_noise_is_what_is_left_and_what_the_uncertainty_says(barrel: Camera) -> None:
    found, said = [], []
    for seed in range(20):
        corners = _corners(barrel, noise=NOISE_PX, seed=seed)
        fit = adjust(barrel, poses_around(barrel, SIZE, 10, seed=1), corners, POINTS)
        assert fit.rms_px == pytest.approx(NOISE_PX, rel=0.15)
        found.append(fit.camera.focal_px)
        said.append(np.sqrt(fit.spread[0, 0]) * fit.rms_px / np.sqrt(2))
    assert np.std(found) == pytest.approx(np.mean(said), rel=0.5)


def test_held_out_error_is_as_expected_where_views_agree(barrel: Camera) -> None:
    corners = _corners(barrel, noise=NOISE_PX)
    fit = adjust(barrel, poses_around(barrel, SIZE, 10, seed=1), corners, POINTS)
    judged = judge(fit, corners, POINTS)
    assert judged.rms_px > fit.rms_px
    np.testing.assert_allclose(judged.of_views_px / judged.expected_px, 1, atol=0.4)


def test_the_simplest_model_that_explains_is_taken(barrel: Camera) -> None:
    judged, outliers = judge_all(_corners(barrel, noise=NOISE_PX), POINTS, SIZE)
    assert not outliers
    assert simplest(judged).fit.camera.model.name == "radial_2"
    assert [one.fit.camera.model for one in judged] == list(MODELS)


def test_a_worse_model_is_taken_only_within_its_uncertainty(barrel: Camera) -> None:
    corners = _corners(barrel, noise=NOISE_PX)
    fit = adjust(barrel, poses_around(barrel, SIZE, 10, seed=1), corners, POINTS)
    good = judge(fit, corners, POINTS)
    same = replace(good)
    worse = replace(good, held_out=good.held_out * 1.02)
    assert simplest([same, good]) is same
    assert simplest([worse, good]) is good
    # less than 2 % of the error are worth no number, however certain they are
    assert simplest([(hardly := replace(good, held_out=good.held_out * 1.019)), good]) is hardly


@pytest.mark.parametrize("bad", [{0}, {4}, {2, 7}])
def test_views_of_another_board_are_named(barrel: Camera, bad: set[int]) -> None:
    poses = poses_around(barrel, SIZE, 10, seed=1)
    corners = _corners(barrel, noise=NOISE_PX)
    skewed = POINTS @ np.array([[1.03, 0, 0], [0.03, 1, 0], [0, 0, 1]])
    for view in bad:
        corners[view] = project(barrel, poses[view], skewed)[0]
    _, outliers = judge_all(corners, POINTS, SIZE)
    assert set(outliers) == bad
    assert all(error > 4 * NOISE_PX for error in outliers.values())


@pytest.mark.parametrize("seed", range(3))
def test_corners_of_no_board_are_judged_without_a_stumble(seed: int) -> None:
    corners = np.random.default_rng(seed).uniform(0, 300, (4, len(POINTS), 2))
    judged, _ = judge_all(corners, POINTS, SIZE)
    assert all(one.rms_px > 10 for one in judged)


def test_three_good_views_are_not_called_bad(barrel: Camera) -> None:
    _, outliers = judge_all(_corners(barrel, count=3, noise=NOISE_PX), POINTS, SIZE)
    assert not outliers


def test_a_board_turned_half_round_is_the_same_board(barrel: Camera) -> None:
    corners = _corners(barrel, noise=NOISE_PX)
    turned = corners.copy()
    turned[::2] = turned[::2, ::-1]
    one, other = (fit_models(c, POINTS, SIZE)[2] for c in (corners, turned))
    np.testing.assert_allclose(one.camera.intrinsics, other.camera.intrinsics, atol=1e-3)
    assert rms(one.residuals) == pytest.approx(rms(other.residuals), rel=1e-6)
