"""The phase that one direction of light would want of a thin plate (eq. 3.1-3.3)."""

import math

import numpy as np
from numpy.typing import NDArray

from camkit.units import to_mm

Array = NDArray[np.float64]


def ideal_phase(
    radius_mm: Array,
    field_angle_rad: float,
    height_mm: float,
    distance_mm: float,
    wavelength_um: float,
) -> Array:
    """Return the phase along the meridian that sends a direction to one point of the sensor.

    Args:
        radius_mm: Any shape, signed, where the light meets the plate.
        field_angle_rad: Of the light.
        height_mm: Of the image point.
        distance_mm: From the plate to the sensor.
        wavelength_um: Of the light.

    Returns:
        Radians, 0 at radius 0; a larger phase is a longer way.

    References: Sun 2021, eq. (3.3).
    """
    way = radius_mm * math.sin(field_angle_rad) + np.hypot(distance_mm, height_mm - radius_mm)
    number = 2 * math.pi / to_mm(wavelength_um)
    return np.asarray(-number * (way - math.hypot(distance_mm, height_mm)))
