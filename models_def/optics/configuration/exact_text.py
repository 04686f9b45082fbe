"""Numbers of a prescription as the shortest text that comes back to the last bit."""

import math

from camkit.units import to_degrees, to_radians


def degrees_text(angle_rad: float) -> str:
    """Return the shortest number of degrees that becomes this angle again, to the last bit."""
    angle_deg = to_degrees(angle_rad)
    neighbours = (angle_deg, math.nextafter(angle_deg, 0), math.nextafter(angle_deg, 90))
    for digits in range(1, 18):
        for value in neighbours:
            rounded = float(f"{value:.{digits}g}")
            if to_radians(rounded) == angle_rad:
                return repr(rounded)
    return repr(angle_deg)


def radius_text(curvature_per_mm: float) -> str:
    """Return the shortest radius whose inverse is this curvature."""
    if not curvature_per_mm:
        return "inf"
    radius_mm = 1 / curvature_per_mm
    # 1 / (1 / r) may be a neighbour of r
    neighbours = (radius_mm, math.nextafter(radius_mm, 0), math.nextafter(radius_mm, math.inf))
    for digits in range(4, 18):
        for value in neighbours:
            rounded = float(f"{value:.{digits}g}")
            if 1 / rounded == curvature_per_mm:
                return repr(rounded)
    return repr(radius_mm)
