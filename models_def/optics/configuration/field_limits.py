"""Limits of field angles: 140 degrees for a distant object, 89.5 for a near one."""

import math
from collections.abc import Sequence
from typing import Final

from camkit.errors import ContractError
from camkit.units import to_radians

WIDEST_DEG: Final = 140.0
"""The widest field of a distant object."""
TANGENT_DEG: Final = 89.5
"""The widest of a near one: up to here fields are tangents."""


def widest_deg(object_distance_mm: float) -> float:
    """Return the largest field angle of an object at a distance in degrees."""
    return WIDEST_DEG if math.isinf(object_distance_mm) else TANGENT_DEG


def check_fields(angles_rad: Sequence[float], object_distance_mm: float) -> None:
    """Refuse field angles that nothing is traced at.

    Raises:
        ContractError: With the widest.
    """
    widest = widest_deg(object_distance_mm)
    if not all(0 <= angle <= to_radians(widest) for angle in angles_rad):
        raise ContractError(f"field angles must lie in 0..{widest:g} degrees")
