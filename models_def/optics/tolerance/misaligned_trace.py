"""Rays through decentred, tilted and irregular surfaces.

Each surface is met in its own frame by the step of `trace`; between surfaces rays are kept in the
frame of the nominal vertices, on the nominal axis.
"""

from collections.abc import Sequence
from dataclasses import replace

import torch

from camkit.models_def.optics.tolerance.figure import Figure, refract_at_figure
from camkit.models_def.optics.trace import Fate, Rays, SurfaceTensors, refract
from camkit.models_def.optics.tracing import frame
from camkit.models_def.optics.tracing.frame import Pose
from camkit.models_def.optics.tracing.meeting import State

_MIN_COSINE = 1e-6


def meet(
    tensors: SurfaceTensors, pose: Pose | None, rays: Rays, i: int, figure: Figure | None = None
) -> Rays:
    """Trace rays onto surface i and refract them; return them in the frame of the surface."""
    here = rays if pose is None else to_surface(pose, rays)
    if figure is None:
        return refract(tensors, here, i)
    return refract_at_figure(figure, tensors, here, i)


def trace_misaligned(
    tensors: SurfaceTensors,
    poses: Sequence[Pose | None],
    rays: Rays,
    *,
    figures: Sequence[Figure | None] = (),
    end: int | None = None,
) -> Rays:
    """Trace rays to the nominal plane after the last surface.

    Args:
        tensors: The lens.
        poses: One for each surface; None where it stands as designed.
        rays: At the vertex plane of the first surface.
        figures: One for each surface; none by default.
        end: Stop in front of this surface; behind the last one by default.

    Returns:
        Rays at z = 0 of the next nominal vertex plane, or of the sensor.
    """
    for i in range(len(poses) if end is None else end):
        pose = poses[i]
        rays = meet(tensors, pose, rays, i, figures[i] if figures else None)
        rays = rays if pose is None else from_surface(pose, rays)
        rays = _to_plane(replace(rays, z=rays.z - tensors.thickness_mm[i]))
    return rays


def to_surface(pose: Pose, rays: Rays) -> Rays:
    """Return rays in the frame of the surface."""
    return replace(rays, **frame.to_surface(pose, _state(rays))._asdict())


def from_surface(pose: Pose, rays: Rays) -> Rays:
    """Return rays in the frame of the nominal vertex."""
    return replace(rays, **frame.from_surface(pose, _state(rays))._asdict())


def _state(rays: Rays) -> State:
    return State(rays.x, rays.y, rays.z, rays.l, rays.m, rays.n)


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
