"""Conversions between the units that camkit's names carry as suffixes."""

import math

UM_PER_MM = 1000.0
MM_PER_M = 1000.0


def to_radians(angle_deg: float) -> float:
    """Convert degrees (what people type) to radians (what the code computes with)."""
    return math.radians(angle_deg)


def to_degrees(angle_rad: float) -> float:
    """Convert radians to degrees."""
    return math.degrees(angle_rad)


def to_mm(length_um: float) -> float:
    """Convert micrometres to millimetres."""
    return length_um / UM_PER_MM
