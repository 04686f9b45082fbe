"""Where points fall, and how that changes."""

import numpy as np
import pytest

from camkit.calibration.geometry.camera_model import (
    MODELS,
    Camera,
    Model,
    distance,
    project,
    with_model,
)
from tests.camkit.calibration.geometry.board_factory import camera_of

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [3, 1, 0]])
POSE = np.array([0.2, -0.3, 0.1, -0.5, -0.4, 4.0])
SLOPE = 1e-6
EXACT_PX = 1e-9
NUMBERS = (-0.2, 0.05, 0.01, -0.02, 0.03, 0.1, -0.04, 0.02)


def _camera(model: Model) -> Camera:
    return camera_of(model, 300, (160.0, 120.0), *NUMBERS[: len(model.free)])


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_slopes_are_those_of_differences(model: Model) -> None:
    camera = _camera(model)
    _, slopes = project(camera, POSE, POINTS)
    numbers = np.concatenate([POSE, camera.intrinsics])
    step = 1e-6
    for i in range(numbers.size):
        ends = []
        for sign in (1, -1):
            moved = numbers.copy()
            moved[i] += sign * step
            ends.append(project(Camera(model=model, intrinsics=moved[6:]), moved[:6], POINTS)[0])
        expected = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(slopes[..., i], expected, rtol=SLOPE, atol=1e-4)


def test_without_distortion_light_goes_straight() -> None:
    camera = camera_of(MODELS[0], 300, (160.0, 120.0))
    at, _ = project(camera, np.array([0, 0, 0, 0, 0, 2.0]), POINTS)
    np.testing.assert_allclose(at, POINTS[:, :2] * 150 + [160, 120], atol=EXACT_PX)


def test_fisheye_without_coefficients_is_equidistant() -> None:
    camera = camera_of(MODELS[4], 300, (160.0, 120.0), 0, 0, 0, 0)
    at, _ = project(camera, np.array([0, 0, 0, 0, 0, 1.0]), np.array([[np.tan(1.2), 0, 0]]))
    np.testing.assert_allclose(at, [[160 + 300 * 1.2, 120]], atol=EXACT_PX)


@pytest.mark.parametrize("fisheye", [False, True])
def test_what_lies_behind_is_nowhere(fisheye: bool) -> None:
    model = next(m for m in MODELS if m.fisheye == fisheye)
    at, _ = project(_camera(model), np.array([0, 0, 0, 0, 0, -2.0]), POINTS)
    assert np.isnan(at).all()


def test_a_richer_model_sees_the_same_at_first() -> None:
    simple = _camera(MODELS[2])
    for model in (MODELS[3], MODELS[5], MODELS[6]):
        richer = with_model(simple, model)
        np.testing.assert_allclose(
            project(richer, POSE, POINTS)[0], project(simple, POSE, POINTS)[0], atol=EXACT_PX
        )


def test_distance_is_that_of_the_point() -> None:
    assert distance(np.array([0, 0, 0, 3.0, 0, 4]), np.zeros(3)) == pytest.approx(5)
    assert distance(np.array([0, 0, 0, 3.0, 0, 4]), np.array([-3.0, 0, 0])) == pytest.approx(4)
