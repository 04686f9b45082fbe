"""Single lenses whose answer is known exactly."""

import math

import pytest
import torch

from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.analysis.first_order import ParaxialRay, ParaxialRays
from camkit.models_def.optics.analysis.seidel import seidel_of_rays
from camkit.models_def.optics.paraxial import focal_lengths, trace_paraxial
from camkit.models_def.optics.trace import Rays, SurfaceTensors, trace
from camkit.models_def.optics.tracing.sag import sag, sag_slope
from tests.physics.printed_lenses import cooke_tensors, lens_tensors, rays_at

EXACT_MM = 2e-13


def _tensors(
    surfaces: list[tuple[float, float, float, float]], *, last_mm: float
) -> SurfaceTensors:
    """Make tensors from (curvature, conic, thickness, index after) rows."""
    values = torch.tensor(surfaces, dtype=torch.float64)
    thickness = values[:, 2].clone()
    thickness[-1] = last_mm
    return SurfaceTensors(
        curvature_per_mm=values[:, 0],
        conic=values[:, 1],
        even_asphere=torch.zeros(len(surfaces), 0, dtype=torch.float64),
        thickness_mm=thickness,
        semi_diameter_mm=torch.full((len(surfaces),), torch.inf, dtype=torch.float64),
        index=torch.cat([torch.ones(1, dtype=torch.float64), values[:, 3]]),
        aspheric=(False,) * len(surfaces),
    )


def _parallel(tensors: SurfaceTensors, half_width_mm: float) -> Rays:
    height = torch.linspace(-half_width_mm, half_width_mm, 21, dtype=torch.float64)
    zero = torch.zeros_like(height)
    return trace(tensors, launch(zero, height, zero, math.inf))


def test_plano_hyperbolic_lens_focuses_without_aberration() -> None:
    """Conic -n^2 on the exit side: all parallel rays meet at R / (n - 1)."""
    tensors = _tensors([(0.0, 0.0, 4.0, 1.5), (-1 / 25, -2.25, 0.0, 1.0)], last_mm=50.0)
    assert float(_parallel(tensors, 10.0).y.abs().max()) < EXACT_MM


def test_ellipsoid_focuses_inside_its_glass_without_aberration() -> None:
    """Conic -1/n^2: all parallel rays meet n R / (n - 1) behind the vertex."""
    tensors = _tensors([(1 / 25, -1 / 2.25, 0.0, 1.5)], last_mm=75.0)
    assert float(_parallel(tensors, 10.0).y.abs().max()) < EXACT_MM


def test_concentric_rays_pass_a_sphere_undeviated() -> None:
    """Rays towards the centre of curvature meet the sphere at right angles."""
    tensors = _tensors([(1 / 30, 0.0, 0.0, 1.7)], last_mm=30.0)
    height = torch.linspace(-9, 9, 11, dtype=torch.float64)
    length = torch.hypot(height, torch.tensor(30.0, dtype=torch.float64))
    zero = torch.zeros_like(height)
    rays = Rays(
        x=zero,
        y=height,
        z=zero,
        l=zero,
        m=-height / length,
        n=30 / length,
        fate=torch.zeros(11, dtype=torch.int8),
    )
    assert float(trace(tensors, rays).y.abs().max()) < EXACT_MM


@pytest.mark.parametrize("angle_deg", [0.0, 15.0, 40.0])
def test_plane_plate_shifts_but_does_not_turn_rays(angle_deg: float) -> None:
    index, thickness = 1.5, 8.0
    tensors = _tensors([(0.0, 0.0, thickness, index), (0.0, 0.0, 0.0, 1.0)], last_mm=0.0)
    slope = torch.tan(torch.deg2rad(torch.tensor(angle_deg, dtype=torch.float64)))
    zero = torch.zeros((), dtype=torch.float64)
    landed = trace(tensors, launch(zero, zero, slope, math.inf))
    inside = math.asin(math.sin(math.radians(angle_deg)) / index)
    assert float(landed.y) == pytest.approx(thickness * math.tan(inside), abs=EXACT_MM)
    assert float(landed.m / landed.n) == pytest.approx(float(slope), abs=EXACT_MM)


def test_thick_lens_focal_length_is_the_lensmaker_s() -> None:
    c1, c2, t, n = 1 / 40, -1 / 60, 7.0, 1.52
    tensors = _tensors([(c1, 0.0, t, n), (c2, 0.0, 0.0, 1.0)], last_mm=0.0)
    power = (n - 1) * (c1 - c2 + (n - 1) * t * c1 * c2 / n)
    efl, bfl = focal_lengths(tensors)
    assert float(efl) == pytest.approx(1 / power, rel=1e-14)
    assert float(bfl) == pytest.approx((1 - (n - 1) * t * c1 / n) / power, rel=1e-14)


def test_refraction_keeps_n_sine_of_a_ray_at_a_plane() -> None:
    tensors = _tensors([(0.0, 0.0, 0.0, 1.62)], last_mm=1.0)
    slope = torch.linspace(0.0, 3.0, 13, dtype=torch.float64)
    zero = torch.zeros_like(slope)
    landed = trace(tensors, launch(zero, zero, slope, math.inf))
    assert torch.allclose(1.62 * landed.m, torch.sin(torch.atan(slope)), rtol=0, atol=1e-15)


def _spherical(tensors: SurfaceTensors) -> float:
    """Give S_I of parallel light at a height of 1 mm."""
    one, zero = torch.ones((), dtype=torch.float64), torch.zeros((), dtype=torch.float64)
    heights, slopes = [one], [zero]
    for i in range(len(tensors.aspheric)):
        if i:
            heights.append(heights[-1] + tensors.thickness_mm[i - 1] * slopes[-1])
        slopes.append(trace_paraxial(tensors, heights[-1], slopes[-1], range(i, i + 1))[1])
    ray = ParaxialRay(height_mm=torch.stack(heights), slope=torch.stack(slopes))
    rays = ParaxialRays(tensors=tensors, marginal=ray, chief=ray)
    return float(seidel_of_rays(rays, torch.zeros_like(tensors.index)).sums_mm[0])


@pytest.mark.parametrize(("perfect", "exit_side"), [(-2.25, True), (-1 / 2.25, False)])
def test_third_order_spherical_aberration_changes_sign_at_the_perfect_conic(
    perfect: float, exit_side: bool
) -> None:
    """-n^2 behind glass, -1 / n^2 in front of it: a hyperbola and an ellipse."""

    def lens(conic: float) -> SurfaceTensors:
        if exit_side:
            return _tensors([(0.0, 0.0, 4.0, 1.5), (-1 / 25, conic, 0.0, 1.0)], last_mm=50.0)
        return _tensors([(1 / 25, conic, 0.0, 1.5)], last_mm=75.0)

    assert _spherical(lens(perfect)) == pytest.approx(0, abs=1e-18)
    assert _spherical(lens(perfect - 0.5)) * _spherical(lens(perfect + 0.5)) < 0


def test_single_sphere_images_parallel_light_at_n_r_over_n_minus_1() -> None:
    """And a real ray where the law of sines in the triangle of centre, ray and axis puts it."""
    index, radius = 1.5, 30.0
    tensors = _tensors([(1 / radius, 0.0, 0.0, index)], last_mm=0.0)
    _, bfl = focal_lengths(tensors)
    assert float(bfl) == pytest.approx(index * radius / (index - 1), rel=1e-14)
    height = torch.linspace(0.5, 20, 14, dtype=torch.float64)
    landed = trace(tensors, launch(torch.zeros_like(height), height, 0 * height, math.inf))
    crossing = -landed.y * landed.n / landed.m
    incidence = torch.asin(height / radius)
    refracted = torch.asin(height / radius / index)
    expected = radius + radius * torch.sin(refracted) / torch.sin(incidence - refracted)
    assert torch.allclose(crossing, expected, rtol=1e-13)


def test_thin_lens_in_contact_adds_the_powers_of_its_faces() -> None:
    c1, c2, n = 1 / 40, -1 / 60, 1.52
    efl, bfl = focal_lengths(_tensors([(c1, 0.0, 0.0, n), (c2, 0.0, 0.0, 1.0)], last_mm=0.0))
    assert float(1 / efl) == pytest.approx((n - 1) * (c1 - c2), rel=1e-14)
    assert float(bfl) == pytest.approx(float(efl), rel=1e-14)


def test_every_ray_keeps_n_sine_of_its_angle_at_every_surface() -> None:
    """Snell's law against the normal of the sphere, and the skew invariant n (x M - y L)."""
    tensors, seen = cooke_tensors(), list[Rays]()
    generator = torch.Generator().manual_seed(3)
    x, y = 4 * torch.rand(2, 200, dtype=torch.float64, generator=generator) - 2
    start = rays_at(x, y - 4.0, math.tan(math.radians(20)))
    landed = trace(tensors, start, surface_rays=seen)
    assert bool(landed.valid.all())
    index, before = tensors.index, start
    skew = start.x * start.m - start.y * start.l
    for i, on in enumerate(seen):
        c = tensors.curvature_per_mm[i]
        normal = torch.stack([-c * on.x, -c * on.y, 1 - c * on.z])
        sines = [
            n * torch.linalg.cross(torch.stack([ray.l, ray.m, ray.n]), normal, dim=0)
            for n, ray in ((index[i], before), (index[i + 1], on))
        ]
        assert torch.allclose(sines[0], sines[1], rtol=0, atol=1e-15)
        invariant = index[i + 1] * (on.x * on.m - on.y * on.l)
        assert torch.allclose(invariant, skew, rtol=0, atol=1e-14)
        before = on


@pytest.mark.parametrize("conic", [-4.0, -0.4, 2.0])
def test_three_forms_of_the_slope_of_a_conic_are_one(conic: float) -> None:
    """Eq. (2.3), c[(1 + s) + alpha rho / (2 s)] / (1 + s)^2 and c / (2 s), up to the equator."""
    c = 1 / 20
    alpha = (1 + conic) * c**2
    reach = torch.tensor([0.0, 1e-12, 1e-3, 0.5, 0.99, 0.999999], dtype=torch.float64)
    rho = (reach / abs(alpha)).requires_grad_()
    s = torch.sqrt(1 - alpha * rho.detach())
    product = alpha * rho.detach()
    thesis = c * (1 + s - product / 2) / (s * (1 + s) ** 2)
    printed = c * ((1 + s) + product / (2 * s)) / (1 + s) ** 2
    curvature, k = (torch.tensor(v, dtype=torch.float64) for v in (c, conic))
    none = torch.zeros(0, dtype=torch.float64)
    (auto,) = torch.autograd.grad(sag(curvature, k, none, rho).sum(), rho)
    for found in (thesis, printed, auto):
        assert torch.allclose(found, sag_slope(curvature, k, none, rho.detach()), rtol=1e-11)


def test_aspheric_singlet_focuses_where_its_r2_term_says() -> None:
    """R 20 with terms in r^2, r^4, r^6; the index follows from the published EFL without r^2."""
    index = 1 + 20 / 25.484006
    lens = lens_tensors(
        [1 / 20, 0.0],
        [7.0, 20.0],
        [1, index, 1],
        even_asphere=[[-2.248851e-4, -4.690412e-6, -6.404376e-8], [0.0, 0.0, 0.0]],
    )
    assert float(focal_lengths(lens)[0]) == pytest.approx(25.7153, abs=5e-5)
    low = torch.tensor([0.01], dtype=torch.float64)
    landed = trace(lens, rays_at(torch.zeros_like(low), low, 0.0))
    assert float(-0.01 * landed.n / landed.m) == pytest.approx(25.7153229, abs=2e-6)
