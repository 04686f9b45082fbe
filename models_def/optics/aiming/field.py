"""Fields as numbers: the tangent of their angle up to 89.5 degrees, and on beyond 90 degrees.

Everything that traces carries a field as its slope. Beyond 89.5 degrees, where the tangent leaves
all bounds, the slope goes on by one per radian, so that it still grows with the angle. Rays of
such fields start on the plane through the first vertex that is perpendicular to them, since they
do not cross the vertex plane of the first surface.
"""

import math
from collections.abc import Sequence
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.configuration.field_limits import TANGENT_DEG
from camkit.units import to_degrees, to_radians

_EDGE_RAD: Final = to_radians(TANGENT_DEG)
STEEPEST: Final = math.tan(_EDGE_RAD)


def field_slope(angle_rad: Tensor) -> Tensor:
    """Return the slopes of field angles of any shape and sign."""
    size = torch.abs(angle_rad)
    steep = torch.sign(angle_rad) * (STEEPEST + size - _EDGE_RAD)
    return torch.where(size > _EDGE_RAD, steep, torch.tan(angle_rad))


def field_angle(slope: Tensor) -> Tensor:
    """Return the angles in radians of slopes: the inverse of `field_slope`."""
    steep = torch.sign(slope) * (torch.abs(slope) - STEEPEST + _EDGE_RAD)
    return torch.where(is_steep(slope), steep, torch.atan(slope))


def slope_of(angle_rad: float) -> float:
    """Return the slope of one angle."""
    steep = math.copysign(STEEPEST + abs(angle_rad) - _EDGE_RAD, angle_rad)
    return steep if abs(angle_rad) > _EDGE_RAD else math.tan(angle_rad)


def is_steep(slope: Tensor) -> Tensor:
    """Return which fields lie beyond 89.5 degrees."""
    return torch.abs(slope) > STEEPEST


def lead_factor(slope: Tensor) -> Tensor:
    """Return how far (mm per mm of lead) below the axis the chief ray starts.

    The lead is the depth of the entrance pupil: tan(angle) of it in the vertex plane, sin(angle)
    of it in the plane perpendicular to a steep ray.
    """
    return torch.where(is_steep(slope), torch.sin(field_angle(slope)), slope)


def widest_tangent(angles_rad: Sequence[float], what: str) -> float:
    """Return tan of the widest field, 0 without any.

    Args:
        angles_rad: Of the fields.
        what: What needs the tangent, for the message.

    Raises:
        ContractError: If a field lies beyond 89.5 degrees.
    """
    widest = max(angles_rad, default=0.0)
    if widest > _EDGE_RAD:
        raise ContractError(
            f"{what} carries fields as tangents and ends at {TANGENT_DEG} degrees; the lens has a "
            f"field of {to_degrees(widest):.4g}: state smaller fields"
        )
    return math.tan(widest)
