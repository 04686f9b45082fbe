"""The light near a peak, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.calibration.peak import PEAK_PX, height_mm, peak_share
from camkit.runtime.capture import Capture

SPREAD_PX, SIDE = 9.0, 121
CAPTURE = Capture(
    samples=np.zeros((60, 80), np.uint16),
    cfa="RGGB",
    black_level=np.zeros((2, 2), np.float32),
    white_level=4095.0,
)


def _bell(side: int = SIDE) -> np.ndarray:
    offset = np.arange(side) - side // 2
    square = offset[:, None] ** 2 + offset[None] ** 2
    return np.exp(-square / (2 * SPREAD_PX**2)) / (2 * np.pi * SPREAD_PX**2)


def test_the_share_of_a_gaussian_is_that_of_its_closed_form() -> None:
    share, error = peak_share(_bell(), np.zeros((SIDE, SIDE)), 0.0)
    assert share == pytest.approx(1 - np.exp(-((PEAK_PX / SPREAD_PX) ** 2) / 2), abs=0.005)
    assert error == 0


def test_a_wrong_black_moves_the_share_by_its_error() -> None:
    light, black = _bell(), 1e-6
    share, error = peak_share(light, np.zeros_like(light), black)
    moved, _ = peak_share(light + black, np.zeros_like(light), 0.0)
    assert abs(moved - share) == pytest.approx(error, rel=0.02)
    assert error > 0.005


@pytest.mark.parametrize("pitch_px", [1, 2])
def test_noise_scatters_the_share_by_its_error(pitch_px: int) -> None:
    rng, light, spread = np.random.default_rng(0), _bell(), 2e-5
    # samples that each stand for pitch x pixels along both axes
    cells = (SIDE + pitch_px - 1) // pitch_px
    found = []
    for _ in range(400):
        noise = spread * rng.standard_normal((cells, cells))
        noise = np.repeat(np.repeat(noise, pitch_px, axis=0), pitch_px, axis=1)[:SIDE, :SIDE]
        found.append(peak_share(light + noise, np.zeros_like(light), 0.0)[0])
    _, error = peak_share(light, np.full_like(light, spread**2), 0.0, pitch_px)
    assert np.std(found) == pytest.approx(error, rel=0.12)


def test_the_height_is_that_from_the_middle_of_the_sensor() -> None:
    assert height_mm(CAPTURE, (39.5 + 30, 29.5 + 40), 4.0) == pytest.approx(0.2)
    part = replace(CAPTURE, origin_px=(100, 200), sensor_size_px=(240, 360))
    assert height_mm(part, (19.5, 9.5), 4.0) == pytest.approx(0.004 * 30)
