"""Rays through decentred and tilted surfaces.

Each surface is met in its own frame by the step of `trace`; between surfaces rays are kept in the
frame of the nominal vertices, on the nominal axis.
"""

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from camkit.models_def.optics.tolerance.pose import Pose
from camkit.models_def.optics.trace import Fate, Rays, SurfaceTensors, refract

_MIN_COSINE = 1e-6


def meet(tensors: SurfaceTensors, pose: Pose | None, rays: Rays, i: int) -> Rays:
    """Trace rays onto surface i and refract them; return them in the frame of the surface."""
    return refract(tensors, rays if pose is None else to_surface(pose, rays), i)


def trace_misaligned(
    tensors: SurfaceTensors, poses: Sequence[Pose | None], rays: Rays, *, end: int | None = None
) -> Rays:
    """Trace rays to the nominal plane after the last surface.

    Args:
        tensors: The lens.
        poses: One for each surface; None where it stands as designed.
        rays: At the vertex plane of the first surface.
        end: Stop in front of this surface; behind the last one by default.

    Returns:
        Rays at z = 0 of the next nominal vertex plane, or of the sensor.
    """
    for i in range(len(poses) if end is None else end):
        pose = poses[i]
        rays = meet(tensors, pose, rays, i)
        rays = rays if pose is None else from_surface(pose, rays)
        rays = _to_plane(replace(rays, z=rays.z - tensors.thickness_mm[i]))
    return rays


def to_surface(pose: Pose, rays: Rays) -> Rays:
    """Return rays in the frame of the surface."""
    dx, dy, dz = (rays.x, rays.y, rays.z)
    ox, oy, oz = pose.offset_mm.unbind(-1)
    turn = pose.turn.transpose(-1, -2)
    x, y, z = _turned(turn, (dx - ox, dy - oy, dz - oz))
    l, m, n = _turned(turn, (rays.l, rays.m, rays.n))  # noqa: E741
    return replace(rays, x=x, y=y, z=z, l=l, m=m, n=n)


def from_surface(pose: Pose, rays: Rays) -> Rays:
    """Return rays in the frame of the nominal vertex."""
    ox, oy, oz = pose.offset_mm.unbind(-1)
    x, y, z = _turned(pose.turn, (rays.x, rays.y, rays.z))
    l, m, n = _turned(pose.turn, (rays.l, rays.m, rays.n))  # noqa: E741
    return replace(rays, x=x + ox, y=y + oy, z=z + oz, l=l, m=m, n=n)


def _turned(turn: Tensor, vector: tuple[Tensor, Tensor, Tensor]) -> list[Tensor]:
    x, y, z = vector
    rows = turn.unbind(-2)
    return [r[..., 0] * x + r[..., 1] * y + r[..., 2] * z for r in rows]


def _to_plane(rays: Rays) -> Rays:
    """Trace rays to z = 0; one that a strong tilt sent backwards is lost."""
    onward = rays.n > _MIN_COSINE
    way = torch.where(onward, -rays.z / torch.where(onward, rays.n, 1.0), 0.0)
    backward = (rays.fate == Fate.VALID) & ~onward
    return replace(
        rays,
        x=rays.x + way * rays.l,
        y=rays.y + way * rays.m,
        z=torch.zeros_like(rays.z),
        fate=torch.where(backward, int(Fate.MISSED), rays.fate).to(torch.int8),
    )
