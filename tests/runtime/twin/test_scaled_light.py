"""Light through optics: lenses changed, lights cropped, scenes finer than the sensor."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.sensor import Extent, PlanesSensor
from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.runtime.simulate import SimulationOptions, simulate
from camkit.runtime.twin.light import (
    LUMINANCE,
    LightOptions,
    cell_means,
    crop_light,
    lens_of,
    light_of,
    scene_window,
    stated_balance,
    with_axis_moved,
    with_kernels,
)
from tests.bundle_factory import tiny_sensor
from tests.camera_factory import delta_psf, make_psf, make_sensor
from tests.psf_factory import texture

SENSOR = make_sensor()


def grey_sensor(width: int = 96, height: int = 64) -> PlanesSensor:
    fields = tiny_sensor().model_dump(
        include={"black_level", "white_level", "full_well_e", "noise"}
    )
    extent = Extent(width_px=width, height_px=height, pixel_pitch_um=SENSOR.pixel_pitch_um)
    response = {
        "wavelengths_um": (0.45, 0.55, 0.62),
        "response": ((1.0, 1.0, 1.0),),
        "source": "made up",
    }
    return PlanesSensor.model_validate(
        fields | {"extent": extent, "channels": ("Y",), "channel_response": response}
    )


@pytest.fixture
def scene() -> FloatArray:
    return texture(64, 96)


def test_changed_kernels_keep_all_light() -> None:
    lens = with_kernels(lens_of(make_psf(SENSOR), SENSOR), lambda k: k**2 - 0.001)
    kernels = lens.kernels_at(0.1, 0.05)
    np.testing.assert_allclose(kernels.sum(axis=(1, 2)), 1, rtol=1e-5)
    assert kernels.min() >= 0


def test_a_moved_axis_takes_its_kernels_along() -> None:
    lens = lens_of(make_psf(SENSOR), SENSOR)
    moved = with_axis_moved(lens, 0.1, -0.05)
    np.testing.assert_array_equal(
        moved.kernels_at(0.3, 0.1), lens.kernels_at(0.3 - 0.1, 0.1 + 0.05)
    )


@pytest.mark.parametrize("scale", [1, 2])
def test_a_crop_of_the_light_stays_where_it_is(scale: int) -> None:
    fine = texture(64 * scale, 96 * scale)
    window = scene_window(fine, SENSOR, None, scale=scale)
    lens = lens_of(make_psf(SENSOR), SENSOR)
    light = light_of(fine, SENSOR, lens, window, LightOptions(scale=scale))
    small = crop_light(light, (17, 9))
    np.testing.assert_array_equal(small.planes, light.planes[:, :9, :17])
    np.testing.assert_array_equal(small.clean, light.clean[:, : 9 * scale, : 17 * scale])
    assert small.window.origin_px == light.window.origin_px
    assert small.window.size_px == (17, 9)


def test_a_pixel_sees_the_mean_of_its_samples_and_the_truth_stays_fine(scene: FloatArray) -> None:
    fine = scene.repeat(2, axis=1).repeat(2, axis=2)
    rng = np.random.default_rng(1)
    ripple = rng.random((1, 64, 2, 96, 2), dtype=np.float32) - 0.5
    ripple -= ripple.mean(axis=(2, 4), keepdims=True)
    fine = np.maximum(fine + 0.05 * ripple.reshape(1, 128, 192), 0)
    psf, options = delta_psf(SENSOR), SimulationOptions(noise=False)
    coarse = simulate(cell_means(fine, 2), SENSOR, psf, options)
    made = simulate(fine, SENSOR, psf, replace(options, scale=2))
    np.testing.assert_array_equal(made.samples, coarse.samples)
    assert made.clean.shape == (3, 128, 192)
    np.testing.assert_allclose(cell_means(made.clean, 2), coarse.clean, atol=2e-6)
    assert made.window == coarse.window


def test_the_fine_truth_is_distorted_as_the_light_is() -> None:
    y, x = np.mgrid[:128, :192]
    blob = np.exp(-((x - 40) ** 2 + (y - 30) ** 2) / 72).astype(np.float32)
    psf = make_psf(SENSOR, distortion=(1.0, -0.1, 0.0, 0.0))
    made = simulate(np.stack([blob] * 3), SENSOR, psf, SimulationOptions(noise=False, scale=2))
    means = cell_means(made.clean, 2)[1]
    coarse = simulate(cell_means(np.stack([blob] * 3), 2), SENSOR, psf, SimulationOptions())
    np.testing.assert_allclose(means, coarse.clean[1], atol=0.02)
    assert np.abs(means - cell_means(blob[None], 2)[0]).max() > 0.1


def test_a_grey_sensor_sees_the_luminance(scene: FloatArray) -> None:
    sensor = grey_sensor()
    shape = replace(delta_psf(SENSOR).distortion, coefficients=np.array([[1.0, 0, 0, 0]]))
    made = simulate(
        scene, sensor, delta_psf(SENSOR, distortion=shape), SimulationOptions(noise=False)
    )
    assert made.samples.shape == (1, 64, 96)
    assert stated_balance(made.white_balance) is None
    expected = np.tensordot(np.array(LUMINANCE, np.float32), scene, axes=1)
    np.testing.assert_allclose(made.clean[0], expected, atol=1e-6)
    span = sensor.white_level - sensor.black_level
    np.testing.assert_allclose(
        (made.samples[0] - sensor.black_level) / span, expected, atol=0.51 / span + 1e-6
    )


def test_a_scene_of_broken_pixels_is_refused(scene: FloatArray) -> None:
    with pytest.raises(ContractError, match="multiples"):
        scene_window(scene[:, :, :-1], SENSOR, None, scale=2)


def test_gains_of_three_colours_are_stated() -> None:
    assert stated_balance((2.0, 1.0, 1.5)) == (2.0, 1.0, 1.5)
