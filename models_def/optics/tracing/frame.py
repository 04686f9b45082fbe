"""Frames of surfaces that are turned and shifted: p = R q + o.

q is a point in the frame of the surface, p in the frame of its nominal vertex.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.meeting import State


class Pose(NamedTuple):
    """The pose of one surface.

    Attributes:
        turn: R, (..., 3, 3); the dimensions before broadcast against the rays.
        offset_mm: o, (..., 3).
    """

    turn: Tensor
    offset_mm: Tensor


def rotation(vector_rad: Tensor) -> Tensor:
    """Return the rotation (..., 3, 3) about (x, y, 0) by its length, right-handed (Rodrigues).

    Args:
        vector_rad: (..., 2).
    """
    x, y = vector_rad.unbind(-1)
    angle = torch.hypot(x, y)
    # sin(a) / a and (1 - cos(a)) / a^2, also at 0
    first = torch.sinc(angle / torch.pi)
    second = torch.sinc(angle / (2 * torch.pi)) ** 2 / 2
    rows = [
        [1 - second * y * y, second * x * y, first * y],
        [second * x * y, 1 - second * x * x, -first * x],
        [-first * y, first * x, 1 - second * (x * x + y * y)],
    ]
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)


def to_surface(pose: Pose, rays: State) -> State:
    """Return rays in the frame of the surface."""
    turn = pose.turn.transpose(-1, -2)
    ox, oy, oz = pose.offset_mm.unbind(-1)
    place = _turned(turn, (rays.x - ox, rays.y - oy, rays.z - oz))
    return State(*place, *_turned(turn, (rays.l, rays.m, rays.n)))


def from_surface(pose: Pose, rays: State) -> State:
    """Return rays in the frame of the nominal vertex."""
    x, y, z = _turned(pose.turn, (rays.x, rays.y, rays.z))
    ox, oy, oz = pose.offset_mm.unbind(-1)
    return State(x + ox, y + oy, z + oz, *_turned(pose.turn, (rays.l, rays.m, rays.n)))


def _turned(turn: Tensor, vector: tuple[Tensor, Tensor, Tensor]) -> list[Tensor]:
    x, y, z = vector
    rows = turn.unbind(-2)
    return [r[..., 0] * x + r[..., 1] * y + r[..., 2] * z for r in rows]
