import math
from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.aim import aim
from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.prescription import Surface
from camkit.models_def.optics.pupil import half_disc, hexapolar, pupil_rays, with_fixed_stop
from camkit.models_def.optics.trace import refract, surface_tensors, trace
from tests.physics.reference_lenses import cooke_triplet

WAVE = torch.tensor(0.55, dtype=torch.float64)
AIM_TOLERANCE_MM = 1e-7


def test_half_disc_covers_the_half_disc_evenly() -> None:
    """Second moments of a uniform half disc: 1/4 each; its centroid 4 / (3 pi)."""
    samples = half_disc(4000)
    assert bool((samples.x >= 0).all())
    assert bool((samples.x**2 + samples.y**2 < 1).all())
    assert float((samples.x**2).mean()) == pytest.approx(0.25, abs=1e-3)
    assert float((samples.y**2).mean()) == pytest.approx(0.25, abs=1e-3)
    assert float(samples.x.mean()) == pytest.approx(4 / (3 * math.pi), abs=1e-3)
    assert float(samples.y.mean()) == pytest.approx(0, abs=1e-3)


def test_hexapolar_has_the_known_count() -> None:
    assert len(hexapolar(6).x) == 127


def test_pupil_without_rays_is_refused() -> None:
    with pytest.raises(ContractError, match="at least one ray"):
        half_disc(0)


def test_parallel_rays_are_parallel_and_a_near_object_s_meet_in_it() -> None:
    x = torch.tensor([0.0, 1.0], dtype=torch.float64)
    slope = torch.tensor(0.3, dtype=torch.float64)
    far = launch(x, x, slope, math.inf)
    assert torch.equal(far.l, torch.zeros(2, dtype=torch.float64))
    assert torch.allclose(far.m / far.n, slope.expand(2))
    near = launch(x, x, slope, 200.0)
    assert torch.allclose(near.x - 200 * near.l / near.n, torch.zeros(2, dtype=torch.float64))
    assert torch.allclose(near.y - 200 * near.m / near.n, -60 * torch.ones(2, dtype=torch.float64))


@pytest.mark.parametrize("distance_mm", [math.inf, 500.0])
def test_aimed_rays_pass_their_points_of_the_stop(distance_mm: float) -> None:
    lens = cooke_triplet()
    tensors = surface_tensors(lens, WAVE)
    unit = hexapolar(4)
    target = (3.8 * unit.x, 3.8 * unit.y)
    slope = torch.tan(torch.deg2rad(torch.tensor([[0.0], [20.0]], dtype=torch.float64)))
    found = aim(replace(lens, object_distance_mm=distance_mm), tensors, target, slope)
    assert bool((found.weight > 0).all())
    rays = trace(tensors, launch(found.x, found.y, slope, distance_mm), surfaces=range(lens.stop))
    at_stop = refract(tensors, rays, lens.stop)
    assert float((at_stop.x - target[0]).abs().max()) < AIM_TOLERANCE_MM
    assert float((at_stop.y - target[1]).abs().max()) < AIM_TOLERANCE_MM


def test_aimed_weight_on_the_axis_is_the_pupil_s_paraxial_magnification() -> None:
    lens = cooke_triplet()
    zero = torch.zeros(1, dtype=torch.float64)
    weight = aim(lens, surface_tensors(lens, WAVE), (zero, zero + 1e-3), zero).weight
    assert float(weight) == pytest.approx((5.0 / 3.80084966) ** 2, rel=1e-5)


def test_rays_that_cannot_be_aimed_weigh_nothing() -> None:
    lens = cooke_triplet()
    wide = replace(lens, aperture_kind="stop_semi_diameter_mm", aperture_value=40.0)
    slope = torch.zeros(1, dtype=torch.float64)
    rays, weight = pupil_rays(wide, surface_tensors(wide, WAVE), half_disc(16), slope)
    lost = weight == 0
    assert bool(lost.any())
    assert not bool(rays.valid[lost].any())


def test_stop_keeps_its_size_when_the_focal_length_changes() -> None:
    fixed = with_fixed_stop(replace(cooke_triplet(), aperture_kind="f_number", aperture_value=5.0))
    assert fixed.aperture_kind == "stop_semi_diameter_mm"
    assert fixed.aperture_value == pytest.approx(3.80083, abs=1e-4)


def test_plane_stop_in_front_needs_no_aiming() -> None:
    lens = replace(
        cooke_triplet(),
        surfaces=(Surface(curvature_per_mm=0.0, thickness_mm=5.0), *cooke_triplet().surfaces),
        stop=0,
    )
    unit = hexapolar(2)
    found = aim(lens, surface_tensors(lens, WAVE), (unit.x, unit.y), torch.tensor([[0.2]]).double())
    assert torch.equal(found.x[0], unit.x)
    assert torch.equal(found.weight, torch.ones_like(found.weight))
