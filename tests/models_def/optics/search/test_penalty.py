import math
from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.search.penalty import edge_gaps, ray_penalty, reach_rho
from camkit.models_def.optics.trace import Fate, Rays, SurfaceTensors, trace
from tests.physics.printed_lenses import cooke_tensors, lens_tensors, rays_at

F64 = torch.float64


def _ball(curvature: float) -> SurfaceTensors:
    return lens_tensors([curvature, 0.0], [2.0, 10.0], [1, 1.5, 1])


def _pays(lens: SurfaceTensors, y: torch.Tensor) -> tuple[torch.Tensor, Rays]:
    launched = rays_at(torch.zeros_like(y), y, 0.0)
    seen: list[Rays] = []
    landed = trace(lens, launched, surface_rays=seen)
    return ray_penalty(lens, launched, seen), landed


def test_rays_well_inside_pay_nothing() -> None:
    cost, landed = _pays(cooke_tensors(), torch.linspace(-4, 4, 9, dtype=F64))
    assert bool(landed.valid.all())
    assert float(cost.max()) == 0


def test_the_penalty_rises_without_a_step_from_inside_to_outside_a_sphere() -> None:
    y = torch.linspace(4.5, 5.5, 2001, dtype=F64)
    cost, landed = _pays(lens_tensors([1 / 5], [10.0], [1, 1.5]), y)
    assert len(landed.fate.unique()) > 1
    change = cost.diff()
    assert float(change.min()) >= 0
    assert float(change.max()) < 0.1
    assert float(cost[-1]) > float(cost[0])


@pytest.mark.parametrize(
    ("lens", "height", "fate"),
    [
        (_ball(1 / 5), 6.0, Fate.MISSED),
        (lens_tensors([0.0, -1 / 5], [2.0, 1.0], [1, 1.5, 1]), 4.0, Fate.TOTAL_REFLECTION),
        (
            replace(_ball(1 / 50), semi_diameter_mm=torch.tensor([3.0, 9.0], dtype=F64)),
            3.5,
            Fate.VIGNETTED,
        ),
    ],
)
def test_a_lost_ray_pulls_the_lens_to_where_it_passes(
    lens: SurfaceTensors, height: float, fate: Fate
) -> None:
    curvature = lens.curvature_per_mm.clone().requires_grad_()
    y = torch.tensor([height], dtype=F64, requires_grad=True)
    cost, landed = _pays(replace(lens, curvature_per_mm=curvature), y)
    assert landed.fate.tolist() == [fate]
    bend, lower = torch.autograd.grad(cost.sum(), [curvature, y])
    assert float(lower[0]) > 0
    assert bool(torch.isfinite(bend).all())


def test_surfaces_behind_the_first_failure_are_silent() -> None:
    front = _ball(1 / 5)
    steep = lens_tensors([1 / 5, 0.0, 1 / 2], [2.0, 1.0, 1.0], [1, 1.5, 1, 1.5])
    y = torch.tensor([6.0], dtype=F64)
    assert float(_pays(front, y)[0]) == float(_pays(steep, y)[0])


def test_an_edge_lies_at_the_height_of_living_rays() -> None:
    """Two equal spheres back to back: the edge is the gap less two sags."""
    lens = lens_tensors([1 / 20, -1 / 20], [1.0, 10.0], [1, 1.5, 1])
    lens = replace(lens, thickness_mm=lens.thickness_mm.requires_grad_())
    y = torch.tensor([3.0, 50.0], dtype=F64)
    seen: list[Rays] = []
    landed = trace(lens, rays_at(0 * y, y, 0.0), surface_rays=seen)
    assert landed.fate.tolist() == [Fate.VALID, Fate.MISSED]
    edges = edge_gaps(lens, [reach_rho(rays, lens.thickness_mm[0]) for rays in seen])
    sag = 20 - math.sqrt(20**2 - 3**2)
    assert edges.tolist() == pytest.approx([1 - 2 * sag], rel=1e-9)
    (slope,) = torch.autograd.grad(edges.sum(), lens.thickness_mm)
    assert slope.tolist() == [1, 0]


def test_an_edge_beyond_the_end_of_a_sphere_lies_at_its_rim() -> None:
    lens = lens_tensors([0.0, 1 / 5], [1.0, 10.0], [1, 1.5, 1])
    wide = torch.tensor(8.0**2, dtype=F64)
    (edge,) = edge_gaps(lens, [wide, wide]).tolist()
    assert edge == pytest.approx(1 + 5, abs=0.2)


def test_wrong_lists_are_refused() -> None:
    y = torch.tensor([1.0], dtype=F64)
    with pytest.raises(ContractError, match="surfaces"):
        ray_penalty(_ball(0.1), rays_at(y, y, 0.0), [])
    with pytest.raises(ContractError, match="reaches"):
        edge_gaps(_ball(0.1), [])
