"""Rays from the sensor to the scene, through the same surfaces in the opposite order.

In this direction z counts from the sensor towards the scene; x and y stay as they are. So the
scene point of a field at the slope s (see `pupil.launch`) is met at y = -s times its distance.
"""

import math
from dataclasses import replace

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.trace import Rays, SurfaceTensors, refract, trace
from camkit.models_def.optics.tracing.frame import Pose


def reverse(tensors: SurfaceTensors) -> SurfaceTensors:
    """Return the lens as light from the sensor meets it.

    The gap to the sensor stays last, where it means nothing: replace it by what follows.
    """
    gaps = tensors.thickness_mm.flip(0)
    return replace(
        tensors,
        curvature_per_mm=-tensors.curvature_per_mm.flip(0),
        conic=tensors.conic.flip(0),
        even_asphere=-tensors.even_asphere.flip(0),
        thickness_mm=torch.cat([gaps[1:], gaps[:1]]),
        semi_diameter_mm=tensors.semi_diameter_mm.flip(0),
        index=tensors.index.flip(0),
        aspheric=tensors.aspheric[::-1],
        grooves=tuple(
            None if g is None else replace(g, solid_after=not g.solid_after)
            for g in tensors.grooves[::-1]
        ),
        odd_asphere=None if tensors.odd_asphere is None else -tensors.odd_asphere.flip(0),
        series=tensors.series[::-1],
        phase=None if tensors.phase is None else tensors.phase.flip(0),
        order_mm=None if tensors.order_mm is None else tensors.order_mm.flip(0),
        phases=tensors.phases[::-1],
        poses=tuple(p and _reversed_pose(p) for p in tensors.poses[::-1]),
    )


def _reversed_pose(pose: Pose) -> Pose:
    """Return a pose with z counted the other way."""
    flip = torch.tensor([1.0, 1.0, -1.0]).to(pose.offset_mm)
    return Pose(turn=pose.turn * flip[:, None] * flip, offset_mm=pose.offset_mm * flip)


def launch_with_slopes(x_mm: Tensor, y_mm: Tensor, slope_x: Tensor, slope_y: Tensor) -> Rays:
    """Start rays on the sensor (z = 0) with slopes towards the scene; all broadcast."""
    n = torch.rsqrt(1 + slope_x**2 + slope_y**2)
    blank = torch.zeros_like(n)
    return Rays(
        x=x_mm + blank,
        y=y_mm + blank,
        z=blank,
        l=slope_x * n,
        m=slope_y * n,
        n=n,
        fate=torch.zeros_like(n, dtype=torch.int8),
    )


def trace_to_scene(
    tensors: SurfaceTensors,
    rays: Rays,
    object_distance_mm: float,
    *,
    path: bool = False,
    compiled: bool = False,
    steep: bool = False,
) -> Rays:
    """Trace rays from the sensor to the scene.

    Args:
        tensors: The lens (in the order of the light of a photograph).
        rays: On the sensor (z = 0 there), n > 0 towards the scene.
        object_distance_mm: From the first vertex to the plane of the scene; inf for none.
        path: See `trace`.
        compiled: See `trace`.
        steep: Let rays leave across the axis and backwards: of a distant scene, uncompiled.

    Returns:
        Rays on the plane of the scene; for a distant one on the vertex plane of the first
        surface (steep ones on that surface), where only their directions count.
    """
    if not object_distance_mm >= 0:
        raise ContractError(f"object_distance_mm must be >= 0; got {object_distance_mm}")
    lens = reverse(tensors)
    beyond_mm = 0.0 if math.isinf(object_distance_mm) else object_distance_mm
    last = torch.full_like(lens.thickness_mm[-1:], beyond_mm)
    lens = replace(lens, thickness_mm=torch.cat([lens.thickness_mm[:-1], last]))
    shifted = replace(rays, z=rays.z - tensors.thickness_mm[-1])
    if not steep:
        return trace(lens, shifted, path=path, compiled=compiled)
    front = len(lens.aspheric) - 1
    inside = trace(lens, shifted, surfaces=range(front), path=path)
    return refract(lens, replace(inside, steep=True), front)
