"""Intersection of rays with a surface that is cut into grooves, and the loss at its walls.

The continuous profile h(r) is laid down in rings: wherever |h| has grown by the groove depth d it
begins anew at the vertex plane, so that z = h - k d with k the whole part of h / d, counted
towards zero. Between two rings stands a wall parallel to the axis. With walls a ray meets what is
there: from the front of the relief it goes through its ring to the profile, or passes over a wall
into the next ring, or meets a wall and is lost; bent, it is lost if it meets the next groove
before it has left the relief. Without walls (ideal grooves) a ray is bent at the ring over which
it crosses the vertex plane, continued as far as need be.

One ring more or less is seen on the way through the relief. The tool that cuts the grooves has a
round nose, which leaves a fillet at the foot of each wall. The nose of radius R touches wall and
profile; they meet at 90 degrees less the lean a of the profile, so it touches the profile at
R tan(45 degrees + a / 2) from the corner, which is R (1 + sin a) from the wall. What falls between
is lost.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.meeting import (
    MIN_COSINE,
    Meeting,
    Numbers,
    State,
    heights,
    meet_asphere,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Groove:
    """The grooves of a surface as the tracer knows them.

    Attributes:
        depth_mm: Of a groove.
        walls: Whether walls stop rays.
        tool_radius_mm: Of the nose of the tool; 0 leaves sharp feet.
        solid_after: Whether the solid lies after the surface; it says which end of a ring is the
            foot of a wall.
    """

    depth_mm: float
    walls: bool
    tool_radius_mm: float
    solid_after: bool


class GrooveMeeting(NamedTuple):
    """Rays on a grooved surface, before refraction.

    `ring` is the number k of the ring, `wall` tells which rays a wall or its foot took; None
    without walls.
    """

    hit: Meeting
    ring: Tensor
    wall: Tensor | None


def ring_number(p: Numbers, rho: Tensor, groove: Groove) -> Tensor:
    """Return the number k of the ring at rho = r^2, as floats."""
    return torch.trunc(heights(p, rho).height / groove.depth_mm)


def meet_grooves(p: Numbers, at: State, groove: Groove, *, adaptive: bool) -> GrooveMeeting:
    """Return the points at which rays from the vertex plane meet a grooved surface."""
    depth = groove.depth_mm
    height = heights(p, torch.addcmul(at.x * at.x, at.y, at.y)).height
    if not groove.walls:
        ring = torch.trunc(height / depth)
        return GrooveMeeting(_meet_ring(p, at, ring, groove, adaptive=adaptive), ring, None)
    # a relief of negative heights begins a depth before the vertex plane
    lead = torch.where(height < 0, -depth / at.n, 0.0)
    entered = ring_number(p, _rho(at, lead), groove)
    first = _meet_ring(p, at, entered, groove, adaptive=adaptive)
    # where the ray left the ring that it had entered, it may meet the next one
    ring = ring_number(p, first.rho, groove)
    hit = first
    if not (adaptive and bool((ring == entered).all())):
        hit = _meet_ring(p, at, ring, groove, adaptive=adaptive)
    wall = ring_number(p, hit.rho, groove) != ring
    if groove.tool_radius_mm:
        wall = wall | _in_fillet(hit, ring, groove)
    return GrooveMeeting(hit, ring, wall)


def _meet_ring(p: Numbers, at: State, ring: Tensor, groove: Groove, *, adaptive: bool) -> Meeting:
    return meet_asphere(p, at, adaptive=adaptive, drop=ring * groove.depth_mm)


def _rho(at: State, way: Tensor) -> Tensor:
    x, y = torch.addcmul(at.x, way, at.l), torch.addcmul(at.y, way, at.m)
    return torch.addcmul(x * x, y, y)


def _in_fillet(hit: Meeting, ring: Tensor, groove: Groove) -> Tensor:
    """Return a mask of the rays that meet the rounding at the foot of a wall."""
    deep = hit.z.abs()
    # the foot is where the relief is deepest in the solid
    at_full_depth = (hit.z >= 0) == groove.solid_after
    rest_mm = torch.where(at_full_depth, groove.depth_mm - deep, deep)
    # the ring around the vertex plane has no wall at height 0
    has_foot = at_full_depth | (ring != 0)
    slope = hit.lean.abs() * torch.sqrt(hit.rho)
    sine = slope / torch.sqrt(1 + slope * slope)
    return has_foot & (rest_mm < groove.tool_radius_mm * (1 + sine) * slope)


def meets_again(
    p: Numbers, met: GrooveMeeting, bent: State, groove: Groove, *, adaptive: bool
) -> Tensor:
    """Return a mask of the bent rays that meet the next groove before they leave the relief."""
    onward = bent.n.clamp_min(MIN_COSINE)
    back = torch.where(met.hit.z + met.ring * groove.depth_mm < 0, 0.0, groove.depth_mm)
    # the line of the bent ray, from the vertex plane
    rise = met.hit.z / onward
    x = torch.addcmul(bent.x, rise, bent.l, value=-1)
    y = torch.addcmul(bent.y, rise, bent.m, value=-1)
    line = State(x=x, y=y, z=torch.zeros_like(x), l=bent.l, m=bent.m, n=onward)
    ring = ring_number(p, _rho(line, back / onward), groove)
    other = ring != met.ring
    if adaptive and not bool(other.any()):
        return other
    # in the next ring the ray is behind the profile already, or meets the groove from outside
    there = _meet_ring(p, line, ring, groove, adaptive=adaptive)
    return other & (ring_number(p, there.rho, groove) == ring)
