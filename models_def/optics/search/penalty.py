"""A penalty that keeps a design where rays pass, smooth on both sides of the border.

Each ray has margins at each surface: that it meets the conic, that the surface exists there, that
it lies within the rim, that it is not totally reflected. All are 1 in the middle of a weak lens
and 0 at the border. A ray pays ((barrier - margin) / barrier)^2 for margins below the barrier, at
every surface up to the first where it fails and not beyond, where nothing it says has a meaning.
What a ray pays is continuous where it begins to fail; it falls by a step where a ray that failed
further back begins to fail here.
Heights for limits of thickness are taken from living rays alone, for the same reason.
"""

from collections.abc import Sequence
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.trace import Rays, SurfaceTensors

BARRIER: Final = 0.05
_TINY: Final = 1e-6
_INNER_SHARE: Final = 1 - 1e-3


def ray_penalty(
    tensors: SurfaceTensors, launched: Rays, surface_rays: Sequence[Rays], barrier: float = BARRIER
) -> Tensor:
    """Return the penalty of each ray (shape of the rays); differentiable, also for lost rays.

    Args:
        tensors: The lens.
        launched: At the vertex plane of the first surface.
        surface_rays: From `trace`, all surfaces.
        barrier: The margin below which a ray pays.

    Raises:
        ContractError: If `surface_rays` misses a surface, or the barrier is not in 0..1.
    """
    if len(surface_rays) != len(tensors.aspheric):
        raise ContractError(
            f"expected {len(tensors.aspheric)} surfaces in seen; got {len(surface_rays)}"
        )
    if not 0 < barrier < 1:
        raise ContractError(f"barrier must lie in 0..1; got {barrier}")
    total = torch.zeros_like(surface_rays[-1].x)
    incoming, depth = launched, launched.z
    for i, hits in enumerate(surface_rays):
        margins = _margins(tensors, incoming, depth, hits, i)
        cost = torch.zeros_like(hits.x)
        for margin in margins:
            cost = cost + torch.relu(1 - margin / barrier) ** 2
        # a lost ray whose margins do not say why, as one that did not converge
        cost = torch.where(hits.valid | (cost > 0), cost, 1.0)
        total = total + torch.where(incoming.valid, cost, 0.0)
        incoming, depth = hits, hits.z - tensors.thickness_mm[i]
    return total


def _margins(
    tensors: SurfaceTensors, incoming: Rays, depth: Tensor, hits: Rays, i: int
) -> list[Tensor]:
    c, k = tensors.curvature_per_mm[i], tensors.conic[i]
    way = -depth / incoming.n
    x, y = incoming.x + way * incoming.l, incoming.y + way * incoming.m
    # the conic, as in `tracing.kernel`; a ray that misses it is judged where it passes nearest
    a = c * (1 + k * incoming.n**2)
    b = incoming.n - c * (x * incoming.l + y * incoming.m)
    g = c * (x**2 + y**2)
    square = b**2 - a * g
    denominator = b + torch.sqrt(square.clamp_min(_TINY))
    near = g / torch.where(denominator > _TINY, denominator, 1.0)
    hit_x = torch.where(hits.valid, hits.x, x + near * incoming.l)
    hit_y = torch.where(hits.valid, hits.y, y + near * incoming.m)
    rho = hit_x**2 + hit_y**2
    exists = 1 - (1 + k) * c**2 * rho
    lean = 2 * tensors.slope(i, rho)
    facing = incoming.n - lean * (hit_x * incoming.l + hit_y * incoming.m)
    ratio = tensors.index[i] / tensors.index[i + 1]
    transmits = 1 - ratio**2 * (1 - facing**2 / (1 + lean**2 * rho))
    inside = 1 - rho / tensors.semi_diameter_mm[i] ** 2
    margins = [exists, transmits, inside, facing]
    return margins if tensors.aspheric[i] else [square, *margins]


def reach_rho(rays: Rays, like: Tensor) -> Tensor:
    """Return the largest r^2 in mm^2 of living rays, in the shape of a number of the lens."""
    rho = torch.where(rays.valid, rays.x**2 + rays.y**2, 0.0)
    extra = rho.ndim - like.ndim
    dims = [d for d in range(rho.ndim) if d < extra or like.shape[d - extra] == 1]
    return rho.amax(dims, keepdim=True).reshape(like.shape) if dims else rho


def edge_gaps(tensors: SurfaceTensors, reaches: Sequence[Tensor]) -> Tensor:
    """Return the thickness of elements and gaps at their edges in mm, differentiable.

    The edge lies at the larger of the heights that living rays reach on the two surfaces; a
    conic that ends further in counts with the height of its rim.

    Args:
        tensors: The lens.
        reaches: Of each surface, see `reach_rho`.

    Returns:
        (gap, ...), the rest as in the tensors' thickness; gaps are those between two surfaces.

    Raises:
        ContractError: If a surface has no reach.
    """
    if len(reaches) != len(tensors.aspheric):
        raise ContractError(f"expected {len(tensors.aspheric)} reaches; got {len(reaches)}")
    rows = []
    for i in range(len(reaches) - 1):
        rho = torch.maximum(reaches[i], reaches[i + 1])
        bend = _height(tensors, i + 1, rho) - _height(tensors, i, rho)
        rows.append(tensors.thickness_mm[i] + bend)
    return torch.stack(rows)


def _height(tensors: SurfaceTensors, i: int, rho: Tensor) -> Tensor:
    c, k = tensors.curvature_per_mm[i], tensors.conic[i]
    rim = _INNER_SHARE / ((1 + k) * c**2).clamp_min(_TINY)
    return tensors.height(i, torch.minimum(rho, rim))
