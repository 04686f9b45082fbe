from dataclasses import replace

import numpy as np
import pytest

from camkit.psf import FrozenPsf
from camkit.runtime.geometry.illumination import (
    GAIN_SAMPLES,
    IlluminationGain,
    divide_illumination,
    illumination_band,
)
from camkit.runtime.geometry.sensor_window import SensorWindow
from tests.camera_factory import PITCH_UM, make_psf, make_sensor, whole_window
from tests.psf_factory import grid_psf, streak_kernel, uniform_psf

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


def test_a_picture_is_looked_up_or_computed_with_the_same_bits() -> None:
    sensor = make_sensor()
    psf, window = make_psf(sensor), whole_window(sensor)
    gain = IlluminationGain(psf, window)
    computed = gain.divide(np.ones((3, 64, 96), dtype=np.float32), 0)
    gain._table = gain._gains(np.arange(GAIN_SAMPLES + 1))
    looked_up = gain.divide(np.ones((3, 64, 96), dtype=np.float32), 0)
    np.testing.assert_array_equal(looked_up, computed)


AXIS_PX = (20.0, 50.0)


def test_light_falls_away_from_the_axis_wherever_it_is() -> None:
    psf = make_psf(make_sensor(200, 160))  # it reaches every corner from there
    window = replace(whole_window(make_sensor()), axis_px=AXIS_PX)
    light = illumination_band(psf, window, 0, 64)
    assert light[50, 20] == pytest.approx(1.0, abs=1e-6)
    assert light[50, 20] == light.max()
    np.testing.assert_allclose(light, slow_twin(window, psf), atol=LOOKUP_ERROR)
    np.testing.assert_allclose(light[50, 10], light[50, 30], rtol=1e-6)
    gain = IlluminationGain(psf, window)
    ones = np.ones((1, 64, 96), np.float32)
    np.testing.assert_allclose(gain.divide(ones, 0)[0] * light, 1, rtol=2e-6)


def test_no_axis_gives_the_bits_of_one_in_the_middle() -> None:
    sensor = make_sensor()
    psf, plain = make_psf(sensor), whole_window(sensor)
    stated = replace(plain, axis_px=(47.5, 31.5))
    picture = np.random.default_rng(0).random((3, 64, 96), dtype=np.float32)
    np.testing.assert_array_equal(
        illumination_band(psf, plain, 0, 64), illumination_band(psf, stated, 0, 64)
    )
    np.testing.assert_array_equal(
        *(IlluminationGain(psf, window).divide(picture, 0) for window in (plain, stated))
    )


GRID_X_MM = np.array([-0.25, 0.0, 0.2])
GRID_Y_MM = np.array([-0.1, 0.15])
GRID_LIGHT = np.array([[1.0, 0.9, 0.5], [0.7, 0.8, 0.4]])


def on_grid() -> FrozenPsf:
    streaks = np.stack([streak_kernel(0.0)] * 6).reshape(2, 3, 21, 21)
    psf = grid_psf(streaks, GRID_X_MM, GRID_Y_MM)
    return replace(psf, relative_illumination=GRID_LIGHT.ravel())


@pytest.mark.parametrize("axis_px", [None, AXIS_PX])
def test_between_the_places_of_a_grid_light_is_bilinear_and_beyond_its_rim_it_holds(
    axis_px: tuple[float, float] | None,
) -> None:
    window = replace(whole_window(make_sensor()), axis_px=axis_px)
    found = illumination_band(on_grid(), window, 0, 64)
    rows = [
        [np.interp(float(window.to_mm(x, 0)[0]), GRID_X_MM, row) for x in range(96)]
        for row in GRID_LIGHT
    ]
    for y in range(64):
        y_mm = float(window.to_mm(0, y)[1])
        share = np.interp(y_mm, GRID_Y_MM, [0.0, 1.0])
        wanted = (1 - share) * np.array(rows[0]) + share * np.array(rows[1])
        np.testing.assert_allclose(found[y], wanted, rtol=1e-6)


@pytest.mark.parametrize("channels", [1, 3, 5])
def test_a_grid_is_divided_out_of_any_number_of_channels_wherever_a_band_begins(
    channels: int,
) -> None:
    psf, window = on_grid(), whole_window(make_sensor())
    picture = np.random.default_rng(0).random((channels, 64, 96), dtype=np.float32)
    shaded = picture * illumination_band(psf, window, 0, 64)
    gain = IlluminationGain(psf, window)
    np.testing.assert_allclose(gain.divide(shaded, 0), picture, rtol=1e-6)
    for top, bottom in ((0, 1), (13, 40), (63, 64)):
        band = shaded[:, top:bottom].copy()
        assert gain.divide(band, top, out=band) is band
        np.testing.assert_array_equal(band, gain.divide(shaded, 0)[:, top:bottom])


@pytest.mark.parametrize("channels", [1, 2, 7])
def test_any_number_of_channels_is_divided_alike(channels: int) -> None:
    sensor = make_sensor()
    gain = IlluminationGain(make_psf(sensor), whole_window(sensor))
    band = np.random.default_rng(0).random((channels, 10, 96), dtype=np.float32)
    found = gain.divide(band, 5)
    for channel in range(channels):
        np.testing.assert_array_equal(found[channel], gain.divide(band[channel][None], 5)[0])


def test_uniform_optics_have_one_light() -> None:
    window = whole_window(make_sensor())
    np.testing.assert_array_equal(
        illumination_band(uniform_psf(streak_kernel(0.0)), window, 0, 64), 1.0
    )
