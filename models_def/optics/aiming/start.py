"""Rays as they start: at points of the vertex plane of the first surface.

Those of steep fields (`field`) start on the plane through the first vertex perpendicular to them.
"""

import math
from dataclasses import replace

import torch
from torch import Tensor

from camkit.models_def.optics.aiming.field import field_angle, is_steep
from camkit.models_def.optics.trace import Rays, SurfaceTensors, without_walls


def launch(x: Tensor, y: Tensor, slope: Tensor, object_distance_mm: float) -> Rays:
    """Start rays at points of the vertex plane of the first surface.

    Args:
        x: Points in mm; broadcasts with y and slope.
        y: Points in mm; of a steep field along (0, cos(angle), -sin(angle)).
        slope: tan of the field angle (`field_slope`): the object point lies in the direction
            (0, -slope, -1) seen from the first vertex, its image at +y.
        object_distance_mm: From the first vertex; inf for parallel rays. No field of a near
            object is steep.
    """
    blank = torch.zeros_like(x + y + slope)
    x, y, slope = x + blank, y + blank, slope + blank
    if math.isinf(object_distance_mm):
        dx, dy = torch.zeros_like(x), slope
    else:
        dx, dy = x / object_distance_mm, y / object_distance_mm + slope
    n = 1 / torch.sqrt(1 + dx**2 + dy**2)
    steep = is_steep(slope)
    if math.isinf(object_distance_mm) and bool(steep.any()):
        return _steep_launch(x, y, slope, steep)
    return Rays(
        x=x,
        y=y,
        z=torch.zeros_like(x),
        l=dx * n,
        m=dy * n,
        n=n,
        fate=torch.zeros(x.shape, dtype=torch.int8),
    )


def _steep_launch(x: Tensor, y: Tensor, slope: Tensor, steep: Tensor) -> Rays:
    """Start rays of fields of which some are steep."""
    angle = field_angle(slope)
    sine, cosine = torch.sin(angle), torch.cos(angle)
    return Rays(
        x=x,
        y=torch.where(steep, y * cosine, y),
        z=torch.where(steep, -y * sine, 0.0),
        l=torch.zeros_like(x),
        m=sine,
        n=cosine,
        fate=torch.zeros(x.shape, dtype=torch.int8),
        steep=True,
    )


def launch_points(rays: Rays, slope: Tensor) -> tuple[Tensor, Tensor]:
    """Return the points x and y from which `launch` started rays of fields."""
    if not rays.steep:
        return rays.x, rays.y
    angle = field_angle(slope)
    height = rays.y * torch.cos(angle) - rays.z * torch.sin(angle)
    return rays.x, torch.where(is_steep(slope), height, rays.y)


def path_before(rays: Rays, slope: Tensor, object_distance_mm: float, index: Tensor) -> Tensor:
    """Return the optical path in mm of launch points beyond that of the first vertex.

    Written without the loss of a difference of long ways.

    Args:
        rays: Of `launch`.
        slope: tan of their field angle.
        object_distance_mm: From the first vertex; inf for parallel rays.
        index: Of the medium in front of the lens; broadcasts with the rays.
    """
    if math.isinf(object_distance_mm):
        return index * (rays.x * rays.l + rays.y * rays.m + rays.z * rays.n)
    vertex = object_distance_mm * torch.sqrt(1 + slope**2)
    more = rays.x**2 + rays.y**2 + 2 * rays.y * slope * object_distance_mm
    return index * more / (torch.sqrt(vertex**2 + more) + vertex)


def with_open_apertures(tensors: SurfaceTensors) -> SurfaceTensors:
    """Return the lens without the limits of its surfaces: no rim and no wall of a groove."""
    tensors = without_walls(tensors)
    return replace(tensors, semi_diameter_mm=torch.full_like(tensors.semi_diameter_mm, math.inf))
