"""Figure errors of surfaces: power and irregularity in fringes.

A fringe is half a wavelength of 546.07 nm (the green line of mercury), as on drawings by
ISO 10110-5: a surface that is off by one fringe lies 0.273 um beside its place, along its normal.
Fringes are counted over the aperture of the surface, its `semi_diameter_mm`, or as far as the
light of the lens reaches where the file has none.

Of `power` fringes the edge lies that far beside the nominal surface when both touch in the vertex:
the curvature is wrong. `irregularity` is what is left beside the best sphere, from the highest to
the lowest point: h = f / 2 (r / R)^2 cos 2 (phi - psi) fringes. A cylinder of f fringes is such a
saddle of f fringes and f / 2 fringes of power.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final

import torch
from torch import Tensor

from camkit.models_def.optics.aiming.field import widest_tangent
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import hexapolar, pupil_rays, with_fixed_stop
from camkit.models_def.optics.tolerance.deviation import Deviations
from camkit.models_def.optics.trace import (
    Fate,
    Rays,
    SurfaceTensors,
    refract,
    surface_tensors,
    trace,
)
from camkit.units import to_mm

TEST_WAVELENGTH_UM: Final = 0.54607
FRINGE_MM: Final = to_mm(TEST_WAVELENGTH_UM / 2)
_RINGS: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """The irregularity of one surface: it is displaced by a (x^2 - y^2) + 2 b x y.

    Along its normal, towards +z.

    Attributes:
        along_per_mm: a, broadcasts against the rays.
        across_per_mm: b.
    """

    along_per_mm: Tensor
    across_per_mm: Tensor

    def height_mm(self, x: Tensor, y: Tensor) -> Tensor:
        """Return the displacement at x and y in mm."""
        a, b = self.along_per_mm, self.across_per_mm
        return a * (x**2 - y**2) + 2 * b * x * y

    def slope(self, x: Tensor, y: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return the change of the displacement along x, y and z."""
        a, b = self.along_per_mm, self.across_per_mm
        return 2 * (a * x + b * y), 2 * (b * x - a * y), torch.zeros_like(x)


@lru_cache(maxsize=8)
def aperture_radii_mm(lens: Lens) -> tuple[float, ...]:
    """Return the radius of every surface over which its fringes are counted."""
    radii = [surface.semi_diameter_mm for surface in lens.surfaces]
    if all(math.isfinite(radius) for radius in radii):
        return tuple(radii)
    fixed = with_fixed_stop(lens)
    tensors = surface_tensors(fixed, torch.tensor([lens.reference_wavelength_um]))
    edge = widest_tangent(lens.field_angles_rad, "tolerancing")
    slopes = torch.tensor([0.0, edge], dtype=torch.float64)[:, None, None]
    surface_rays: list[Rays] = []
    with torch.no_grad():
        rays, _ = pupil_rays(fixed, tensors, hexapolar(_RINGS), slopes)
        trace(tensors, rays, surface_rays=surface_rays)
    reach = [float(torch.hypot(r.x, r.y)[r.valid].max()) for r in surface_rays]
    return tuple(r if math.isfinite(r) else high for r, high in zip(radii, reach, strict=True))


def power_curvature(curvature: Tensor, conic: Tensor, radius_mm: Tensor) -> Tensor:
    """Return the change of the curvature by one fringe of power, per mm.

    A conic of the curvature c + dc lies dc R^2 / ((1 + S) sqrt(1 - k c^2 R^2)) beside that of c at
    the radius R, along its normal; of a sphere that is (1 - cos) times the change of its radius.

    Args:
        curvature: c, any shape; so are the others.
        conic: k.
        radius_mm: R.
    """
    bend = (curvature * radius_mm) ** 2
    root = torch.sqrt((1 - (1 + conic) * bend).clamp_min(0))
    return FRINGE_MM * (1 + root) * torch.sqrt((1 - conic * bend).clamp_min(0)) / radius_mm**2


def figures(lens: Lens, deviations: Deviations, azimuths_rad: Tensor) -> list[Figure | None]:
    """Return the irregularity of every surface (copy, field, 1, 1), each field turned to +y.

    Args:
        lens: Nominal.
        deviations: The errors.
        azimuths_rad: (field,), from +y towards +x.
    """
    if not deviations.irregularity_fringes.any():
        return [None] * len(lens.surfaces)
    doubled = 2 * azimuths_rad[:, None]
    cos, sin = torch.cos(doubled), torch.sin(doubled)
    numbers = torch.from_numpy(deviations.irregularity_fringes)[:, None]
    # a pattern that is turned by the azimuth turns by twice that in its two numbers
    cosine = cos * numbers[..., 0] - sin * numbers[..., 1]
    sine = sin * numbers[..., 0] + cos * numbers[..., 1]
    per_mm = torch.tensor(
        [FRINGE_MM / 2 / radius**2 for radius in aperture_radii_mm(lens)], dtype=torch.float64
    )

    def spread(values: Tensor) -> Tensor:
        return (values * per_mm).permute(2, 0, 1)[..., None, None]

    pairs = zip(spread(cosine), spread(sine), strict=True)
    return [
        Figure(along_per_mm=a, across_per_mm=b) if a.any() or b.any() else None for a, b in pairs
    ]


def refract_at_figure(figure: Figure, tensors: SurfaceTensors, rays: Rays, i: int) -> Rays:
    """Trace rays onto surface i with its irregularity and refract them, to first order in it.

    A surface that is displaced by h along its normal N is met as the nominal one is by rays that
    are moved by -h N; and its normal leans by the slope of h.

    Args:
        figure: The irregularity.
        tensors: The lens.
        rays: In front of the surface, in its frame; the result is too.
        i: Number of the surface.
    """
    hits = refract(tensors, rays, i)
    height = figure.height_mm(hits.x, hits.y)
    move = [torch.where(hits.valid, height * part, 0.0) for part in _normal(tensors, hits, i)]
    moved_rays = replace(rays, x=rays.x - move[0], y=rays.y - move[1], z=rays.z - move[2])
    hits = refract(tensors, moved_rays, i)
    normal = _normal(tensors, hits, i)
    slope = _tangent(figure.slope(hits.x, hits.y), normal)
    tilted = _unit([n - s for n, s in zip(normal, slope, strict=True)])
    index, next_index = tensors.index[i], tensors.index[i + 1]
    start = [index * d for d in (rays.l, rays.m, rays.n)]
    end = [next_index * d for d in (hits.l, hits.m, hits.n)]
    # Snell: n' d' - n d is along the normal, but for what a phase of the surface adds
    phase = _tangent([new - old for new, old in zip(end, start, strict=True)], normal)
    flat = _tangent([old + more for old, more in zip(start, phase, strict=True)], tilted)
    square = next_index**2 - _dot(flat, flat)
    steep = torch.sqrt(square.clamp_min(0))
    bent = {
        **{k: getattr(hits, k) + part for k, part in zip("xyz", move, strict=True)},
        **{k: (f + steep * n) / next_index for k, f, n in zip("lmn", flat, tilted, strict=True)},
    }
    reflects = hits.valid & (square <= 0)
    keep = hits.valid & ~reflects
    columns: dict[str, Any] = {k: torch.where(keep, v, getattr(hits, k)) for k, v in bent.items()}
    return replace(
        hits,
        **columns,
        fate=torch.where(reflects, int(Fate.TOTAL_REFLECTION), hits.fate).to(torch.int8),
    )


def _normal(tensors: SurfaceTensors, rays: Rays, i: int) -> list[Tensor]:
    """Return the normal of surface i under rays, towards +z."""
    rho = rays.x**2 + rays.y**2
    lean = -2 * tensors.slope(i, rho)
    return _unit([lean * rays.x, lean * rays.y, torch.ones_like(rays.x)])


def _tangent(vector: Sequence[Tensor], normal: Sequence[Tensor]) -> list[Tensor]:
    """Return the part of a vector across the normal."""
    share = _dot(vector, normal)
    return [part - share * n for part, n in zip(vector, normal, strict=True)]


def _dot(first: Sequence[Tensor], second: Sequence[Tensor]) -> Tensor:
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def _unit(vector: Sequence[Tensor]) -> list[Tensor]:
    length = torch.sqrt(_dot(vector, vector))
    return [part / length for part in vector]
