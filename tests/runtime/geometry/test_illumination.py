import numpy as np

from camkit.runtime.geometry.illumination import (
    IlluminationGain,
    divide_illumination,
    illumination_band,
)
from camkit.runtime.geometry.sensor_window import SensorWindow
from tests.camera_factory import PITCH_UM, make_psf, make_sensor, whole_window

LOOKUP_ERROR = 2e-5


def slow_twin(window: SensorWindow, psf: object) -> np.ndarray:
    width, height = window.size_px
    out = np.empty((height, width))
    for row in range(height):
        for column in range(width):
            x_mm, y_mm = window.to_mm(column, row)
            out[row, column] = np.interp(
                x_mm**2 + y_mm**2, psf.field_heights_mm**2, psf.relative_illumination
            )
    return out


def test_lookup_agrees_with_interpolation_at_every_pixel() -> None:
    sensor = make_sensor()
    psf, window = make_psf(sensor), whole_window(sensor)
    found = illumination_band(psf, window, 0, 64)
    np.testing.assert_allclose(found, slow_twin(window, psf), atol=LOOKUP_ERROR)


def test_bands_and_crops_are_parts_of_the_whole() -> None:
    sensor = make_sensor()
    psf = make_psf(sensor)
    whole = illumination_band(psf, whole_window(sensor), 0, 64)
    band = illumination_band(psf, whole_window(sensor), 20, 33)
    np.testing.assert_array_equal(band, whole[20:33])
    crop = SensorWindow(
        size_px=(30, 10), origin_px=(50, 40), sensor_size_px=(96, 64), pitch_um=PITCH_UM
    )
    np.testing.assert_allclose(
        illumination_band(psf, crop, 0, 10), whole[40:50, 50:80], atol=LOOKUP_ERROR
    )


def test_division_undoes_the_multiplication() -> None:
    sensor = make_sensor()
    psf, window = make_psf(sensor), whole_window(sensor)
    picture = np.random.default_rng(0).random((3, 64, 96), dtype=np.float32)
    shaded = picture * illumination_band(psf, window, 0, 64)
    np.testing.assert_allclose(
        divide_illumination(shaded[:, 16:], 16, psf, window), picture[:, 16:], rtol=1e-6
    )


def test_single_pixel_on_the_axis_has_full_light() -> None:
    sensor = make_sensor(1, 1)
    psf = make_psf(make_sensor())
    assert illumination_band(psf, whole_window(sensor), 0, 1) == 1.0


def test_the_gain_is_one_over_the_illumination_wherever_a_band_begins() -> None:
    sensor = make_sensor()
    psf, window = make_psf(sensor), whole_window(sensor)
    light = illumination_band(psf, window, 0, 64)
    gain = IlluminationGain(psf, window)
    ones = np.ones((3, 64, 96), dtype=np.float32)
    whole = gain.divide(ones, 0)
    np.testing.assert_allclose(whole * light, ones, rtol=2e-6)
    for top, bottom in ((0, 1), (13, 40), (63, 64)):
        np.testing.assert_array_equal(gain.divide(ones[:, top:bottom], top), whole[:, top:bottom])
