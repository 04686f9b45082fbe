"""Scenes finer than the sensor: a pixel sees a mean, and the truth stays fine."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.shrink import shrunk
from camkit.runtime.twin.exposure import sample_planes
from camkit.runtime.twin.light import (
    LightOptions,
    crop_light,
    lens_of,
    light_of,
    scene_window,
    stated_balance,
)
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from tests.camera_factory import delta_psf, make_psf, make_sensor
from tests.planes_bundle import planes_sensor
from tests.psf_factory import texture

SENSOR = make_sensor()


@pytest.fixture
def scene() -> FloatArray:
    return texture(64, 96)


def test_a_crop_of_the_light_takes_its_fine_truth_along() -> None:
    fine = texture(128, 192)
    window = scene_window(fine, SENSOR, None, scale=2)
    light = light_of(fine, SENSOR, lens_of(make_psf(SENSOR), SENSOR), window, LightOptions(scale=2))
    small = crop_light(light, (17, 9))
    np.testing.assert_array_equal(small.planes, light.planes[:, :9, :17])
    np.testing.assert_array_equal(small.clean, light.clean[:, :18, :34])


def test_a_pixel_sees_the_mean_of_its_samples_and_the_truth_stays_fine(scene: FloatArray) -> None:
    fine = scene.repeat(2, axis=1).repeat(2, axis=2)
    rng = np.random.default_rng(1)
    ripple = rng.random((1, 64, 2, 96, 2), dtype=np.float32) - 0.5
    ripple -= ripple.mean(axis=(2, 4), keepdims=True)
    fine = np.maximum(fine + 0.05 * ripple.reshape(1, 128, 192), 0)
    psf, options = delta_psf(SENSOR), SimulationOptions(noise=False)
    coarse = simulate(shrunk(fine, 2), SENSOR, psf, options)
    made = simulate(fine, SENSOR, psf, replace(options, scale=2))
    np.testing.assert_array_equal(made.samples, coarse.samples)
    assert made.clean.shape == (3, 128, 192)
    np.testing.assert_allclose(shrunk(made.clean, 2), coarse.clean, atol=2e-6)
    assert made.window == coarse.window


def test_the_fine_truth_is_distorted_as_the_light_is() -> None:
    y, x = np.mgrid[:128, :192]
    blob = np.exp(-((x - 40) ** 2 + (y - 30) ** 2) / 72).astype(np.float32)
    psf = make_psf(SENSOR, distortion=(1.0, -0.1, 0.0, 0.0))
    made = simulate(np.stack([blob] * 3), SENSOR, psf, SimulationOptions(noise=False, scale=2))
    means = shrunk(made.clean, 2)[1]
    coarse = simulate(shrunk(np.stack([blob] * 3), 2), SENSOR, psf, SimulationOptions())
    np.testing.assert_allclose(means, coarse.clean[1], atol=0.02)
    assert np.abs(means - shrunk(blob[None], 2)[0]).max() > 0.1


def test_a_scene_of_broken_pixels_is_refused(scene: FloatArray) -> None:
    with pytest.raises(ContractError, match="multiples"):
        scene_window(scene[:, :, :-1], SENSOR, None, scale=2)


def test_a_window_in_finer_samples_covers_the_same_place() -> None:
    window = SensorWindow(size_px=(40, 24), origin_px=(7, 9), sensor_size_px=(96, 64), pitch_um=6.0)
    fine = window.resampled(0.5, (80, 48))
    pairs = np.array([[0.0, 0.0], [1.0, 1.0]])
    found = [
        np.mean(fine.to_mm(2 * v + np.array([0, 1]), 2 * v + np.array([0, 1])), axis=1)
        for v in pairs[:, 0]
    ]
    expected = [np.ravel(window.to_mm(v, v)) for v in pairs[:, 0]]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_gains_of_three_colours_are_stated_and_others_are_not() -> None:
    assert stated_balance((2.0, 1.0, 1.5)) == (2.0, 1.0, 1.5)
    assert stated_balance((1.0,)) is None


def test_planes_are_seen_without_their_gains() -> None:
    planes = np.full((2, 3, 4), 0.6, np.float32)
    seen = sample_planes(planes, planes_sensor(("a", "b")), (2.0, 1.0))
    np.testing.assert_allclose(seen[:, 0, 0], [0.3, 0.6], rtol=1e-6)
