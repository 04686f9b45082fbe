"""Sequential ray tracing through rotationally symmetric surfaces, differentiable in torch.

Rays are structures of arrays (x, y, z, L, M, N each a tensor). Surface tensors have the surface
as their first dimension; the rest broadcasts against the rays, so that wavelengths, fields and
whole lenses are traced together.
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.glass import find_glass, refractive_index
from camkit.models_def.optics.prescription import Lens

NEWTON_STEPS: Final = 4
NEWTON_TOLERANCE_MM: Final = 1e-7
_MIN_COSINE: Final = 1e-6


class Fate(IntEnum):
    """What became of a ray; the first failure is kept."""

    VALID = 0
    MISSED = 1
    TOTAL_REFLECTION = 2
    VIGNETTED = 3
    NOT_CONVERGED = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceTensors:
    """A lens as tensors; first dimension surface, the rest broadcasts against the rays.

    Attributes:
        curvature_per_mm: (surface, ...).
        conic: (surface, ...).
        even_asphere: (surface, term, ...), coefficients of r^2, r^4, ...
        thickness_mm: (surface, ...), after each surface; the last leads to the sensor.
        semi_diameter_mm: (surface, ...).
        index: (surface + 1, ...), before the first and after each surface.
        aspheric: Which surfaces have a polynomial part.
    """

    curvature_per_mm: Tensor
    conic: Tensor
    even_asphere: Tensor
    thickness_mm: Tensor
    semi_diameter_mm: Tensor
    index: Tensor
    aspheric: tuple[bool, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rays:
    """Rays at a plane or surface; positions in mm relative to the vertex they belong to.

    Attributes:
        x, y, z: Position.
        l, m, n: Direction cosines, n > 0.
        fate: int8, see `Fate`. A ray that is not valid rests on the axis with finite values and
            zero gradients.
    """

    x: Tensor
    y: Tensor
    z: Tensor
    l: Tensor  # noqa: E741
    m: Tensor
    n: Tensor
    fate: Tensor

    @property
    def valid(self) -> Tensor:
        """Which rays are still alive."""
        return self.fate == Fate.VALID


def surface_tensors(lens: Lens, wavelengths_um: Tensor) -> SurfaceTensors:
    """Give the tensors of a lens, float64.

    Args:
        lens: The prescription.
        wavelengths_um: Any shape; the index has (surface + 1, *shape).
    """
    surfaces = lens.surfaces
    terms = max(len(s.even_asphere) for s in surfaces)
    padded = [[*s.even_asphere, *[0.0] * (terms - len(s.even_asphere))] for s in surfaces]
    waves = wavelengths_um.to(torch.float64)
    glass = [refractive_index(find_glass(s.glass), waves) + s.index_offset for s in surfaces]

    def column(values: list[float]) -> Tensor:
        return torch.tensor(values, dtype=torch.float64)

    return SurfaceTensors(
        curvature_per_mm=column([s.curvature_per_mm for s in surfaces]),
        conic=column([s.conic for s in surfaces]),
        even_asphere=torch.tensor(padded, dtype=torch.float64).reshape(len(surfaces), terms),
        thickness_mm=column([s.thickness_mm for s in surfaces]),
        semi_diameter_mm=column([s.semi_diameter_mm for s in surfaces]),
        index=torch.stack([torch.ones_like(waves), *glass]),
        aspheric=tuple(any(s.even_asphere) for s in surfaces),
    )


def sag(curvature: Tensor, conic: Tensor, even_asphere: Tensor, rho: Tensor) -> Tensor:
    """Give the height h(rho) of a surface, rho = r^2 in mm^2 (eq. 2.2, plus an r^2 term).

    Where (1 + conic) c^2 rho > 1 there is no surface: the value is finite but meaningless.
    """
    root = _safe_root(1 - (1 + conic) * curvature**2 * rho)
    return curvature * rho / (1 + root) + rho * _polynomial(even_asphere, rho)


def sag_slope(curvature: Tensor, conic: Tensor, even_asphere: Tensor, rho: Tensor) -> Tensor:
    """Give dh/d rho (eq. 2.3, in the form c / (2 s), s the root, plus the polynomial)."""
    root = _safe_root(1 - (1 + conic) * curvature**2 * rho)
    orders = range(1, even_asphere.shape[0] + 1)
    scaled = [even_asphere[i - 1] * i for i in orders]
    polynomial = _polynomial(torch.stack(scaled), rho) if scaled else torch.zeros_like(rho)
    return curvature / (2 * root) + polynomial


def _safe_root(square: Tensor) -> Tensor:
    positive = square > 1e-12
    return torch.sqrt(torch.where(positive, square, 1.0))


def _polynomial(coefficients: Tensor, rho: Tensor) -> Tensor:
    total = torch.zeros_like(rho)
    for a in reversed(coefficients.unbind(0)):
        total = total * rho + a
    return total


def trace(
    tensors: SurfaceTensors,
    rays: Rays,
    *,
    surfaces: range | None = None,
    seen: list[Rays] | None = None,
) -> Rays:
    """Trace rays to the plane after the last surface (the sensor, if all are traced).

    Args:
        tensors: The lens.
        rays: At the vertex plane of the first surface to be traced (any z is taken along).
        surfaces: Which surfaces, in order; all by default.
        seen: Receives the rays on each surface, after refraction, relative to its vertex.

    Returns:
        Rays on the plane that lies the last thickness after the last surface (z = 0 there).
    """
    for i in surfaces if surfaces is not None else range(len(tensors.aspheric)):
        rays = refract(tensors, rays, i)
        if seen is not None:
            seen.append(rays)
        rays = _to_plane(rays, tensors.thickness_mm[i])
    return rays


def refract(tensors: SurfaceTensors, rays: Rays, i: int) -> Rays:
    """Carry rays onto surface i, judge them, and bend them (Snell)."""
    hit, alive = _intersect(tensors, rays, i)
    outside = hit.x**2 + hit.y**2 > tensors.semi_diameter_mm[i] ** 2
    fate = _first(rays.fate, alive)
    fate = _first(fate, torch.where(outside, int(Fate.VIGNETTED), 0))
    normal = _normal(tensors, hit, i)
    cosine = hit.l * normal[0] + hit.m * normal[1] + hit.n * normal[2]
    fate = _first(fate, torch.where(cosine <= _MIN_COSINE, int(Fate.MISSED), 0))
    ratio = tensors.index[i] / tensors.index[i + 1]
    square = 1 - ratio**2 * (1 - cosine**2)
    fate = _first(fate, torch.where(square <= 1e-12, int(Fate.TOTAL_REFLECTION), 0))
    bend = _safe_root(square) - ratio * cosine
    n = ratio * hit.n + bend * normal[2]
    fate = _first(fate, torch.where(n <= _MIN_COSINE, int(Fate.MISSED), 0))
    bent = replace(
        hit, l=ratio * hit.l + bend * normal[0], m=ratio * hit.m + bend * normal[1], n=n, fate=fate
    )
    return _rest_invalid(bent)


def _first(fate: Tensor, new: Tensor) -> Tensor:
    return torch.where(fate == Fate.VALID, new.to(torch.int8), fate)


def _rest_invalid(rays: Rays) -> Rays:
    ok = rays.valid
    return Rays(
        x=torch.where(ok, rays.x, 0.0),
        y=torch.where(ok, rays.y, 0.0),
        z=torch.where(ok, rays.z, 0.0),
        l=torch.where(ok, rays.l, 0.0),
        m=torch.where(ok, rays.m, 0.0),
        n=torch.where(ok, rays.n, 1.0),
        fate=rays.fate,
    )


def _to_plane(rays: Rays, distance_mm: Tensor) -> Rays:
    way = (distance_mm - rays.z) / rays.n
    return replace(
        rays, x=rays.x + way * rays.l, y=rays.y + way * rays.m, z=torch.zeros_like(rays.z)
    )


def _intersect(tensors: SurfaceTensors, rays: Rays, i: int) -> tuple[Rays, Tensor]:
    """Give the rays on surface i and a fate (0 or why there is no intersection)."""
    at = _to_plane(rays, torch.zeros_like(rays.z))
    c, k = tensors.curvature_per_mm[i], tensors.conic[i]
    # |o + s d|^2 form of the conic: a s^2 - 2 b s + g = 0, the root next to the vertex
    a = c * (1 + k * at.n**2)
    b = at.n - c * (at.x * at.l + at.y * at.m)
    g = c * (at.x**2 + at.y**2)
    square = b**2 - a * g
    root = _safe_root(square)
    sum_ = b + root
    usable = (square > 1e-12) & (sum_ > 1e-9)
    way = torch.where(usable, g / torch.where(usable, sum_, 1.0), 0.0)
    if tensors.aspheric[i]:
        return _newton(tensors, at, way, i)
    hit = _along(at, way)
    usable = usable & (1 - (1 + k) * c * hit.z > 1e-9)
    return hit, torch.where(usable, 0, int(Fate.MISSED))


def _along(rays: Rays, way: Tensor) -> Rays:
    x, y, z = rays.x + way * rays.l, rays.y + way * rays.m, rays.z + way * rays.n
    return replace(rays, x=x, y=y, z=z)


def _newton(tensors: SurfaceTensors, at: Rays, way: Tensor, i: int) -> tuple[Rays, Tensor]:
    """Newton's method from the conic (eq. 6.6); the last step alone carries the gradient.

    That step has a detached denominator: by the implicit function theorem its derivative with
    respect to every parameter is exact at the root.
    """
    way = way.detach()
    with torch.no_grad():
        for _ in range(NEWTON_STEPS):
            gap, slope = _gap(tensors, at, way, i)
            way = way - gap / slope
            way = torch.where(torch.isfinite(way), way, 0.0)
    gap, slope = _gap(tensors, at, way, i)
    way = way - gap / slope.detach()
    hit = _along(at, way)
    inside = _has_surface(tensors, hit, i)
    converged = torch.abs(gap.detach()) < NEWTON_TOLERANCE_MM
    fate = torch.where(converged, 0, int(Fate.NOT_CONVERGED))
    return hit, torch.where(inside, fate, int(Fate.MISSED))


def _has_surface(tensors: SurfaceTensors, hit: Rays, i: int) -> Tensor:
    c, k = tensors.curvature_per_mm[i], tensors.conic[i]
    return 1 - (1 + k) * c**2 * (hit.x**2 + hit.y**2) > 1e-12


def _gap(tensors: SurfaceTensors, at: Rays, way: Tensor, i: int) -> tuple[Tensor, Tensor]:
    c, k, a = tensors.curvature_per_mm[i], tensors.conic[i], tensors.even_asphere[i]
    point = _along(at, way)
    rho = point.x**2 + point.y**2
    gap = sag(c, k, a, rho) - point.z
    slope = 2 * sag_slope(c, k, a, rho) * (point.x * at.l + point.y * at.m) - at.n
    away = torch.abs(slope) > 1e-6
    return gap, torch.where(away, slope, -1.0)


def _normal(tensors: SurfaceTensors, hit: Rays, i: int) -> tuple[Tensor, Tensor, Tensor]:
    """Give the unit normal towards +z."""
    c, k = tensors.curvature_per_mm[i], tensors.conic[i]
    if tensors.aspheric[i]:
        slope = sag_slope(c, k, tensors.even_asphere[i], hit.x**2 + hit.y**2)
        x, y, z = -2 * slope * hit.x, -2 * slope * hit.y, torch.ones_like(hit.z)
    else:
        x, y, z = -c * hit.x, -c * hit.y, 1 - (1 + k) * c * hit.z
    square = x**2 + y**2 + z**2
    length = torch.sqrt(torch.where(square > 1e-18, square, 1.0))
    return x / length, y / length, z / length
