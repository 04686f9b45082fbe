"""Exposure: hidden noise, and mosaics and planes of one light."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.runtime.twin.exposure import Setting, expose, levels_of, sample_planes, signal_of
from camkit.runtime.twin.light import Light
from tests.camera_factory import delta_psf, make_psf, make_sensor, whole_window

SENSOR = make_sensor(320, 240)


def flat_light(level: float, **changes: object) -> Light:
    planes = np.full((3, 240, 320), level, np.float32)
    light = Light(
        planes=planes,
        clean=planes,
        window=whole_window(SENSOR),
        gains=(2.0, 1.0, 1.5),
        vignetting=None,
    )
    return replace(light, **changes)  # type: ignore[arg-type]


def test_hidden_noise_has_the_factor_it_claims() -> None:
    spreads = []
    for factor in (1.0, 3.0):
        dn = expose(flat_light(0.5), SENSOR, Setting(noise_factor=factor))
        greens = (dn[::2, 1::2] - SENSOR.black_level) / (SENSOR.white_level - SENSOR.black_level)
        assert greens.mean() == pytest.approx(0.5, rel=0.01)
        spreads.append(greens.std())
    assert spreads[1] / spreads[0] == pytest.approx(3.0, rel=0.05)


def test_with_other_bits_black_keeps_its_share() -> None:
    assert levels_of(SENSOR, Setting()) == (256, 4095)
    assert levels_of(SENSOR, Setting(bits=8)) == (16, 255)


def test_pixels_see_the_channel_of_their_place_without_its_gain() -> None:
    mosaic = sample_planes(flat_light(0.6).planes, SENSOR, (2.0, 1.0, 1.5))
    np.testing.assert_allclose(mosaic[:2, :2], [[0.3, 0.6], [0.6, 0.4]], rtol=1e-6)


def test_vignetting_dims_what_the_pixels_see() -> None:
    plain = signal_of(flat_light(0.5), SENSOR)
    dimmed = signal_of(flat_light(0.5, vignetting=make_psf(SENSOR, corner_light=0.5)), SENSOR)
    even = signal_of(flat_light(0.5, vignetting=delta_psf(SENSOR)), SENSOR)
    assert dimmed[0, 0] == pytest.approx(0.5 * plain[0, 0], rel=0.02)
    np.testing.assert_allclose(even, plain, rtol=1e-6)
