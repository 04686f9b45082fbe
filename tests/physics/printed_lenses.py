"""Lenses whose indices are printed beside their prescription, as tensors: no glass catalogue."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from camkit.models_def.optics.trace import Rays, SurfaceTensors


def lens_tensors(
    curvatures_per_mm: Sequence[float],
    thicknesses_mm: Sequence[float],
    indices: Sequence[float],
    *,
    conics: Sequence[float] | None = None,
    even_asphere: Sequence[Sequence[float]] | None = None,
    dtype: torch.dtype = torch.float64,
) -> SurfaceTensors:
    """Make a lens without rims; indices in front of the first and behind every surface."""
    count = len(curvatures_per_mm)

    def column(values: Sequence[float]) -> Tensor:
        return torch.tensor(values, dtype=torch.float64).to(dtype)

    terms = [[]] * count if even_asphere is None else even_asphere
    return SurfaceTensors(
        curvature_per_mm=column(curvatures_per_mm),
        conic=column([0.0] * count if conics is None else conics),
        even_asphere=torch.tensor(terms, dtype=torch.float64).reshape(count, -1).to(dtype),
        thickness_mm=column(thicknesses_mm),
        semi_diameter_mm=column([math.inf] * count),
        index=column(indices),
        aspheric=tuple(any(row) for row in terms),
    )


def cooke_tensors(
    dtype: torch.dtype = torch.float64, conic: float = 0.0, r4: float = 0.0
) -> SurfaceTensors:
    """The 40 degree Cooke triplet at 0.55 um; with `r4` an even asphere on every surface."""
    radii = (22.01359, -435.76044, -22.21328, 20.29192, 79.68360, -18.39533)
    crown, flint = 1.6226085614386923, 1.623655122927604
    return lens_tensors(
        [1 / r for r in radii],
        (3.25896, 6.00755, 0.99997, 4.75041, 2.95208, 42.20778),
        (1, crown, 1, flint, 1, crown, 1),
        conics=[conic] * 6,
        even_asphere=[[0.0, r4]] * 6 if r4 else None,
        dtype=dtype,
    )


def double_gauss() -> SurfaceTensors:
    """The f/2 double Gauss of CODE V's listing at 587.6 nm; the stop is surface 5."""
    ssk2, sk2, f5, sk16 = (
        1.6222915007887073,
        1.6073788585843214,
        1.6034171781909698,
        1.6204079330698105,
    )
    return lens_tensors(
        (
            *(0.01779284094091543, 0.006566600536925569, 0.02653743294670983, 0.0),
            *(0.04126892878570084, 0.0, -0.03523942654429074, 0.0),
            *(-0.02636750828657709, 0.005636604951748545, -0.0125926458590576),
        ),
        (
            *(8.75, 0.5, 12.5, 3.8, 16.36944492653564, 13.74795696388906),
            *(3.8, 11.0, 0.5, 7.0, 61.4875364179821 - 0.4002686453541377),
        ),
        (1, ssk2, 1, sk2, f5, 1, 1, f5, sk16, 1, sk16, 1),
    )


def rays_at(x: Tensor, y: Tensor, slope: float, z: Tensor | None = None) -> Rays:
    """Parallel rays through points, rising towards +y."""
    n = 1 / math.sqrt(1 + slope**2)
    one = torch.ones_like(x)
    return Rays(
        x=x,
        y=y,
        z=torch.zeros_like(x) if z is None else z,
        l=0 * one,
        m=slope * n * one,
        n=n * one,
        fate=torch.zeros_like(x, dtype=torch.int8),
    )
