import math
from dataclasses import replace

import pytest
import torch

from camkit.models_def.optics.reverse import launch_with_slopes, reverse, trace_to_scene
from camkit.models_def.optics.trace import Rays, trace
from tests.physics.printed_lenses import cooke_tensors, rays_at

EXACT_MM = 1e-10
SLOPE = 0.2


def _landed(r4: float) -> Rays:
    x = torch.linspace(-3, 3, 9, dtype=torch.float64)
    return trace(cooke_tensors(conic=-0.2, r4=r4), rays_at(x, 0.5 * x - 2.3, SLOPE), path=True)


def _turned(rays: Rays) -> Rays:
    """The same lines, run backwards, in the reversed frame."""
    return replace(rays, l=-rays.l, m=-rays.m, path_mm=None)


@pytest.mark.parametrize("r4", [0.0, 1e-6])
def test_light_returns_on_its_own_way(r4: float) -> None:
    """Also its optical path is the same."""
    landed = _landed(r4)
    back = trace_to_scene(cooke_tensors(conic=-0.2, r4=r4), _turned(landed), math.inf, path=True)
    x = torch.linspace(-3, 3, 9, dtype=torch.float64)
    assert bool(back.valid.all())
    assert float((back.x - x).abs().max()) < EXACT_MM
    assert float((back.y - (0.5 * x - 2.3)).abs().max()) < EXACT_MM
    assert float((back.m / back.n + SLOPE).abs().max()) < EXACT_MM
    assert landed.path_mm is not None
    assert back.path_mm is not None
    assert float((back.path_mm - landed.path_mm).abs().max()) < EXACT_MM


def test_rays_go_on_to_the_plane_of_the_scene() -> None:
    landed = _turned(_landed(0.0))
    lens = cooke_tensors(conic=-0.2)
    near, far = (trace_to_scene(lens, landed, d) for d in (math.inf, 1000.0))
    assert float((far.y - (near.y + 1000 * near.m / near.n)).abs().max()) < EXACT_MM
    # an image at +y belongs to a scene point below the axis
    assert float(far.y.max()) < 0


def test_reversing_twice_gives_the_lens() -> None:
    lens = cooke_tensors(conic=-0.3, r4=1e-6)
    twice = reverse(reverse(lens))
    assert torch.equal(twice.curvature_per_mm, lens.curvature_per_mm)
    assert torch.equal(twice.even_asphere, lens.even_asphere)
    assert torch.equal(twice.index, lens.index)


def test_the_gradient_reaches_the_distance_to_the_sensor() -> None:
    lens = cooke_tensors()
    gaps = lens.thickness_mm.requires_grad_()
    one = torch.ones(1, dtype=torch.float64)
    rays = launch_with_slopes(0 * one, 5 * one, 0 * one, -0.1 * one)
    trace_to_scene(replace(lens, thickness_mm=gaps), rays, 1000.0).y.sum().backward()
    assert gaps.grad is not None
    assert float(gaps.grad[-1]) != 0
