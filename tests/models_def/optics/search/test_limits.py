from dataclasses import replace

import pytest
import torch

from camkit.models_def.optics.search.beam_launch import leading
from camkit.models_def.optics.search.limits import Limits, ray_residuals
from camkit.models_def.optics.search.problem import (
    Problem,
    limits_of,
    residuals,
    trace_batch,
    valid_share,
)
from camkit.models_def.optics.search.variables import Variable


def cost(problem: Problem, limits: Limits) -> float:
    """Give what limits cost the lens as it stands."""
    given = replace(problem, limits=limits)
    scaled = problem.free.scaled()[None]
    traced = trace_batch(given, scaled, torch.inf)
    return float(limits_of(given, traced, torch.inf).square().sum())


def test_a_lens_inside_its_limits_costs_nothing(problem: Problem) -> None:
    loose = Limits(min_edge_mm=0.1, min_air_mm=0.0, min_bfl_mm=10.0)
    assert cost(problem, loose) == 0


@pytest.mark.parametrize(
    "limits",
    [
        Limits(min_edge_mm=8.0, min_air_mm=0.0),
        Limits(min_edge_mm=0.1, min_air_mm=9.0),
        Limits(min_edge_mm=0.1, min_air_mm=0.0, min_bfl_mm=60.0),
        Limits(min_edge_mm=0.1, min_air_mm=0.0, max_curvature_per_mm=0.01),
        Limits(min_edge_mm=0.1, min_air_mm=0.0, distortion=1e-5),
    ],
)
def test_each_limit_costs_what_breaks_it(limits: Limits, problem: Problem) -> None:
    assert cost(problem, limits) > 1e-4


def test_rays_on_the_axis_leave_the_slope_of_the_limits_finite(problem: Problem) -> None:
    given = replace(problem, limits=Limits(min_edge_mm=8.0))
    scaled = problem.free.scaled()[None].requires_grad_()
    traced = trace_batch(given, scaled, torch.inf)
    limits_of(given, traced, torch.inf).square().sum().backward()  # type: ignore[no-untyped-call]
    assert scaled.grad is not None
    assert bool(torch.isfinite(scaled.grad).all())


def limits_cost(problem: Problem, scaled: torch.Tensor) -> torch.Tensor:
    """Give what the limits cost each lens of a batch."""
    traced = trace_batch(problem, scaled, torch.inf)
    return limits_of(problem, traced, torch.inf).square().sum(1)


def wild(problem: Problem, lenses: int) -> tuple[Problem, torch.Tensor]:
    """Give lenses anywhere within wide bounds; most of them lose rays."""
    vary = [Variable(kind="curvature", surface=i, low=-0.25, high=0.25) for i in range(5)]
    vary += [Variable(kind="conic", surface=i, low=-10, high=10) for i in range(6)]
    vary += [Variable(kind="even_asphere", surface=4, term=1, low=-1e-3, high=1e-3)]
    free = replace(problem.free, variables=tuple(vary))
    drawn = torch.rand(lenses, len(vary), generator=torch.Generator().manual_seed(4)).double()
    return replace(problem, free=free, limits=Limits(distortion=0.05)), drawn


def test_wild_lenses_have_finite_residuals_and_slopes(problem: Problem) -> None:
    given, drawn = wild(problem, 300)
    share = valid_share(given, drawn)
    assert float((share < 1).double().mean()) > 0.8
    assert float((share == 0).double().mean()) > 0.05
    assert bool(torch.isfinite(residuals(given, drawn)).all())
    drawn.requires_grad_()
    (slope,) = torch.autograd.grad(limits_cost(given, drawn).sum(), drawn)
    assert bool(torch.isfinite(slope).all())
    assert bool((slope[share < 1].abs().amax(1) > 0).all())


def test_the_slope_of_the_limits_brings_lost_rays_back(problem: Problem) -> None:
    """Rays lost by a front surface bent too much, and by nothing else."""
    vary = (Variable(kind="curvature", surface=0, low=0.03, high=0.4),)
    free = replace(problem.free, variables=vary, solved=None, efl_mm=None)
    given = replace(problem, free=free, limits=Limits(min_edge_mm=-50.0, min_air_mm=-50.0))
    bent = torch.tensor([[0.95]], dtype=torch.float64, requires_grad=True)
    assert float(valid_share(given, bent.detach())) < 1
    traced = trace_batch(given, bent, torch.inf)
    rays = ray_residuals(
        traced.tensors, leading(traced.launched), [leading(rays) for rays in traced.surface_rays]
    )
    (slope,) = torch.autograd.grad(rays.square().sum(), bent)
    assert float(slope) > 0
    assert float(limits_cost(given, torch.tensor([[0.0]], dtype=torch.float64))) == 0
