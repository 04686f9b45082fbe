"""Smooth functions over half the pupil: few rays traced, many interpolated.

A wave PSF needs thousands of rays, though paths and directions of a lens vary smoothly over its
pupil. Here they are known at the points of a coarse quadrature and become polynomials, products of
Chebyshev's T_2i(x) T_j(y), even in x since the pupil is its own mirror image. The points are fixed,
so the fit is a constant matrix and gradients flow through it at no cost.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import torch
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from torch import Tensor

from camkit.models_def.optics.analysis.sampling import disc_quadrature
from camkit.models_def.optics.pupil import PupilSamples

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class FitGrid:
    """The rays of a fit.

    Attributes:
        rings: Of the quadrature.
        arms: Of the quadrature, even and more than twice the degree; half of them are traced.
        degree: Of the polynomials in x and y together.
    """

    rings: int
    arms: int
    degree: int


FIT_GRIDS: Final = (
    FitGrid(rings=8, arms=24, degree=10),
    FitGrid(rings=12, arms=40, degree=18),
    FitGrid(rings=20, arms=68, degree=32),
)
"""From smooth lenses to those with strong aspheres."""


def half_quadrature(rings: int, arms: int) -> PupilSamples:
    """Return the points x > 0 of `disc_quadrature`; their weights sum to half the disc."""
    samples = disc_quadrature(rings, arms)
    half = samples.x > 0
    assert samples.weight is not None
    return PupilSamples(x=samples.x[half], y=samples.y[half], weight=samples.weight[half])


@lru_cache(maxsize=8)
def fit_matrix(grid: FitGrid) -> Tensor:
    """Return the matrix (term, ray) that takes values at the rays to coefficients."""
    samples = half_quadrature(grid.rings, grid.arms)
    assert samples.weight is not None
    weight = torch.sqrt(samples.weight)
    basis = _basis(samples, grid.degree)
    matrix: Tensor = torch.linalg.pinv(basis * weight[:, None]) * weight
    return matrix


@lru_cache(maxsize=8)
def slope_matrices(grid: FitGrid) -> tuple[Tensor, Tensor]:
    """Return matrices (ray, term) that take coefficients to slopes along x and y at the rays."""
    samples = half_quadrature(grid.rings, grid.arms)
    return _basis(samples, grid.degree, (1, 0)), _basis(samples, grid.degree, (0, 1))


@lru_cache(maxsize=2)
def value_matrix(rings: int, arms: int, degree: int) -> Tensor:
    """Return the matrix (point, term) that takes coefficients to values on another quadrature."""
    return _basis(half_quadrature(rings, arms), degree)


def _basis(samples: PupilSamples, degree: int, derivative: tuple[int, int] = (0, 0)) -> Tensor:
    x, y = (
        _polynomials(place.numpy(), degree, times)
        for place, times in zip((samples.x, samples.y), derivative, strict=True)
    )
    columns = [x[:, i] * y[:, j] for i in range(0, degree + 1, 2) for j in range(degree - i + 1)]
    return torch.from_numpy(np.stack(columns, axis=1))


def _polynomials(place: Array, degree: int, derivative: int) -> Array:
    values: Array = chebyshev.chebvander(place, degree).astype(np.float64)
    if not derivative:
        return values
    slopes = chebyshev.chebder(np.eye(degree + 1), axis=0)
    return np.asarray(values[:, :degree] @ slopes)
