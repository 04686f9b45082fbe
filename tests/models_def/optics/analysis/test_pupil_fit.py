import pytest
import torch

from camkit.models_def.optics.analysis.pupil_fit import (
    FIT_GRIDS,
    FitGrid,
    fit_matrix,
    half_quadrature,
    slope_matrices,
    value_matrix,
)

# products of Chebyshev polynomials are less and less independent on a disc
TOLERANCE = {10: 1e-11, 18: 1e-9, 32: 1e-5}


@pytest.mark.parametrize("grid", FIT_GRIDS)
def test_smooth_function_is_known_everywhere_from_few_rays(grid: FitGrid) -> None:
    """A polynomial of degree 9, even in x, with coma and trefoil of high order in it."""
    rays, fine = half_quadrature(grid.rings, grid.arms), half_quadrature(40, 160)

    def height(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        square = x**2 + y**2
        return square**4 * y + 2 * (y**3 - 3 * y * x**2) * square**2 - square + 0.5

    found = value_matrix(40, 160, grid.degree) @ (fit_matrix(grid) @ height(rays.x, rays.y))
    assert float((found - height(fine.x, fine.y)).abs().max()) < TOLERANCE[grid.degree]


@pytest.mark.parametrize("grid", FIT_GRIDS)
def test_slopes_are_those_of_the_function(grid: FitGrid) -> None:
    rays = half_quadrature(grid.rings, grid.arms)
    terms = fit_matrix(grid) @ (rays.x**4 * rays.y + rays.y**3)
    along_x, along_y = (matrix @ terms for matrix in slope_matrices(grid))
    tolerance = 10 * TOLERANCE[grid.degree]
    assert float((along_x - 4 * rays.x**3 * rays.y).abs().max()) < tolerance
    assert float((along_y - rays.x**4 - 3 * rays.y**2).abs().max()) < tolerance


def test_half_a_quadrature_holds_half_the_disc() -> None:
    half = half_quadrature(8, 24)
    assert half.weight is not None
    assert float(half.weight.sum()) == pytest.approx(0.5)
    assert bool((half.x > 0).all())
