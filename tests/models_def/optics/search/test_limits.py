from dataclasses import replace

import pytest
import torch

from camkit.models_def.optics.search.limits import Limits
from camkit.models_def.optics.search.problem import Problem, limits_of, trace_batch


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
