"""The ideal phase against eq. (3.1), integrated slowly."""

import math

import numpy as np
import pytest

from camkit.models_def.optics.thin.ideal import ideal_phase


@pytest.mark.parametrize(("angle_rad", "height_mm"), [(0.0, 0.0), (0.2, 8.5), (0.5, 21.5)])
def test_the_ideal_phase_is_the_integral_of_its_deflections(
    angle_rad: float, height_mm: float
) -> None:
    """Eq. (3.1) with the output angle of eq. (3.2), by the trapezium rule."""
    wave_mm, distance_mm = 0.55e-3, 43.0
    radius = np.linspace(0, 11.7, 200_001)
    sine = np.sin(np.arctan((height_mm - radius) / distance_mm))
    steps = (sine[1:] + sine[:-1]) / 2 * np.diff(radius)
    integral = np.concatenate([[0.0], np.cumsum(steps)])
    slow = -2 * math.pi / wave_mm * (radius * math.sin(angle_rad) - integral)
    found = ideal_phase(radius, angle_rad, height_mm, distance_mm, 0.55)
    assert np.abs(found - slow).max() < 1e-4
    assert found[0] == 0


def test_an_ideal_plate_of_one_direction_makes_equal_ways() -> None:
    """Phase and ways before and after sum to one number: Fermat."""
    radius = np.linspace(-11.7, 11.7, 101)
    angle_rad, height_mm, distance_mm, wave_um = 0.3, 13.0, 43.0, 0.55
    phase = ideal_phase(radius, angle_rad, height_mm, distance_mm, wave_um)
    ways = radius * math.sin(angle_rad) + np.hypot(distance_mm, height_mm - radius)
    total = phase * wave_um * 1e-3 / (2 * math.pi) + ways
    assert np.ptp(total) < 1e-11
