"""Rays that cross the axis at right angles, or run backwards, where they enter a lens.

The kernel takes every ray to the vertex plane first, which such rays meet far out or never. Here a
ray meets the surface from wherever it starts, in plain operations that autograd differentiates:
there are few such rays, and only the first surfaces of a fisheye see them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.kernel import (
    MISSED,
    NOT_CONVERGED,
    TOTAL_REFLECTION,
    VIGNETTED,
    rest,
)
from camkit.models_def.optics.tracing.meeting import MIN_COSINE, MIN_SLOPE, State
from camkit.models_def.optics.tracing.profile import TINY

STEEP_COSINE: Final = 0.02
_NEWTON_STEPS: Final = 20
_STOP_MM: Final = 1e-13
_TOLERANCE_MM: Final = {torch.float32: 5e-5, torch.float64: 1e-9}


@dataclass(frozen=True, slots=True, kw_only=True)
class SteepSurface:
    """A round surface; its numbers broadcast against the rays.

    Attributes:
        curvature: In 1 / mm.
        conic: Its constant.
        profile: Takes rho = r^2 to the height h in mm and dh/d rho.
        aspheric: Whether the profile is more than that of the conic.
        reach_mm: Semi-diameter.
        before: Refractive index in front.
        after: Behind.
    """

    curvature: Tensor
    conic: Tensor
    profile: Callable[[Tensor], tuple[Tensor, Tensor]]
    aspheric: bool
    reach_mm: Tensor
    before: Tensor
    after: Tensor


def cross_steep(
    surface: SteepSurface, rays: State, fate: Tensor, path_mm: Tensor | None
) -> tuple[State, Tensor, Tensor]:
    """Trace rays onto a surface and refract them.

    The derivative of the meeting is that of one Newton step from where it was found, which is
    exact by the implicit function theorem.

    Args:
        surface: The surface.
        rays: Relative to its vertex, at any place before it.
        fate: int8, 0 where a ray lives.
        path_mm: Optical path so far; None for 0.

    Returns:
        Rays on the surface, bent; their fates; the optical path.
    """
    with torch.no_grad():
        way, exists = _way(surface, rays)
    here = _at(rays, way)
    height, half_lean = surface.profile(here.x**2 + here.y**2)
    lean = 2 * half_lean.detach()
    facing = rays.n - (here.x * rays.l + here.y * rays.m).detach() * lean
    facing = torch.where(facing > MIN_SLOPE, facing, 1.0).detach()
    gap = height - here.z
    way = torch.where(exists, way + gap / facing, 0.0)
    hit = _at(rays, way)
    bent, square = _refracted(surface, hit)
    rho = hit.x**2 + hit.y**2
    new = torch.where(bent.n > -1 + MIN_COSINE, 0, MISSED)
    new = torch.where(square > TINY, new, TOTAL_REFLECTION)
    new = torch.where(rho <= surface.reach_mm**2, new, VIGNETTED)
    new = torch.where(gap.detach().abs() < _TOLERANCE_MM[way.dtype], new, NOT_CONVERGED)
    new = torch.where(exists, new, MISSED)
    code = torch.where(fate == 0, new, fate).to(torch.int8)
    length = surface.before * way
    length = length if path_mm is None else path_mm + length
    return rest(bent, code, adaptive=True), code, length


def _at(rays: State, way: Tensor) -> State:
    x, y, z = (p + way * d for p, d in ((rays.x, rays.l), (rays.y, rays.m), (rays.z, rays.n)))
    return rays._replace(x=x, y=y, z=z)


def _way(surface: SteepSurface, rays: State) -> tuple[Tensor, Tensor]:
    """Return the way to where rays enter, and which do.

    With F = c (x^2 + y^2 + (1 + k) z^2) - 2 z the way is a root of a s^2 - 2 b s + g: the one at
    which N.d = b - a s > 0, where light that comes from the object enters.
    """
    c, opening = surface.curvature, 1 + surface.conic
    a = c * (1 + surface.conic * rays.n**2)
    b = rays.n - c * (rays.x * rays.l + rays.y * rays.m + opening * rays.z * rays.n)
    g = c * (rays.x**2 + rays.y**2 + opening * rays.z**2) - 2 * rays.z
    square = b**2 - a * g
    root = torch.sqrt(square.clamp_min(0))
    is_ahead = b > 0
    near = g / torch.where(is_ahead, b + root, 1.0).clamp_min(TINY)
    far = (b - root) / torch.where(a.abs() > TINY, a, 1.0)
    way = torch.where(is_ahead, near, far)
    exists = (square > TINY) & (is_ahead | (a.abs() > TINY))
    way = torch.where(exists, way, 0.0)
    if surface.aspheric:
        way = _newton_way(surface, rays, way)
    here = _at(rays, way)
    # a bowl that opens towards the scene has its rim in the way of rays from behind
    exists = exists & ((rays.n > 0) | (c > 0)) & (1 - opening * c * here.z > MIN_SLOPE)
    return torch.where(exists, way, 0.0), exists


def _newton_way(surface: SteepSurface, rays: State, way: Tensor) -> Tensor:
    for _ in range(_NEWTON_STEPS):
        here = _at(rays, way)
        height, half_lean = surface.profile(here.x**2 + here.y**2)
        gap = height - here.z
        if bool(gap.abs().amax() <= _STOP_MM):
            break
        facing = rays.n - (here.x * rays.l + here.y * rays.m) * 2 * half_lean
        facing = torch.where(facing.abs() > MIN_COSINE, facing, 1.0)
        way = torch.nan_to_num(way + gap / facing, nan=0.0, posinf=0.0, neginf=0.0)
    return way


def _refracted(surface: SteepSurface, hit: State) -> tuple[State, Tensor]:
    """Refract rays on a surface (Snell); return them and the square of N.d'."""
    rho = hit.x**2 + hit.y**2
    lean = 2 * surface.profile(rho)[1]
    length2 = 1 + lean**2 * rho
    facing = hit.n - (hit.x * hit.l + hit.y * hit.m) * lean
    ratio = surface.before / surface.after
    square = (1 - ratio**2) * length2 + (ratio * facing) ** 2
    root = torch.sqrt(torch.where(square > TINY, square, 1.0))
    bend = (root - ratio * facing) / length2
    bent = hit._replace(
        l=ratio * hit.l - bend * lean * hit.x,
        m=ratio * hit.m - bend * lean * hit.y,
        n=ratio * hit.n + bend,
    )
    return bent, square
