import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.trace import (
    Fate,
    SurfaceTensors,
    surface_tensors,
    trace,
)
from camkit.models_def.optics.tracing.sag import sag, sag_slope

ONE_SURFACE_TOLERANCE_MM = 1e-10


def _lens(*surfaces: Surface) -> Lens:
    return Lens(
        name="t",
        surfaces=surfaces,
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=10.0,
    )


def _tensors(*surfaces: Surface) -> SurfaceTensors:
    return surface_tensors(_lens(*surfaces), torch.tensor(0.55, dtype=torch.float64))


def _column(*values: float) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


def test_sag_slope_is_the_derivative_of_the_sag() -> None:
    """The closed form c / (2 s) equals eq. (2.3) and autograd, at the vertex and near the rim."""
    c, k, a = 1 / 20, -0.4, _column(1e-4, -2e-6, 3e-9, 1e-11, 1e-14, 1e-17)
    rho = torch.tensor([0.0, 1e-8, 1.0, 80.0, 640.0], dtype=torch.float64, requires_grad=True)
    curvature, conic = torch.tensor(c), torch.tensor(k)
    (auto,) = torch.autograd.grad(sag(curvature, conic, a, rho).sum(), rho)
    found = sag_slope(curvature, conic, a, rho.detach())
    assert torch.allclose(found, auto, rtol=1e-12, atol=0)
    alpha, r = (1 + k) * c**2, rho.detach()
    s = torch.sqrt(1 - alpha * r)
    thesis = c * (1 + s - alpha * r / 2) / (s * (1 + s) ** 2)
    thesis = thesis + sum(i * a[i - 1] * r ** (i - 1) for i in range(1, 7))
    assert torch.allclose(found, thesis, rtol=1e-6, atol=0)


@pytest.mark.parametrize("even_asphere", [(), (1e-4, 2e-6, -1e-8, 1e-10, 0.0, 1e-15)])
def test_rays_land_on_the_surface(even_asphere: tuple[float, ...]) -> None:
    surface = Surface(
        curvature_per_mm=1 / 25,
        thickness_mm=3.0,
        glass="N-BK7-Schott",
        conic=-0.7,
        even_asphere=even_asphere,
    )
    tensors = _tensors(surface)
    y = torch.linspace(-9, 9, 41, dtype=torch.float64)
    seen: list = []
    trace(
        tensors, launch(torch.full_like(y, 0.5), y, torch.tensor(0.2), math.inf), surface_rays=seen
    )
    on = seen[0]
    assert bool(on.valid.all())
    height = sag(_column(1 / 25)[0], _column(-0.7)[0], _column(*even_asphere), on.x**2 + on.y**2)
    assert float((height - on.z).abs().max()) < ONE_SURFACE_TOLERANCE_MM
    assert torch.allclose(on.l**2 + on.m**2 + on.n**2, torch.ones_like(y), rtol=0, atol=1e-14)


def test_asphere_without_terms_traces_as_its_conic() -> None:
    plain = Surface(curvature_per_mm=1 / 25, thickness_mm=30.0, glass="N-BK7-Schott", conic=-0.7)
    tensors = _tensors(plain)
    forced = SurfaceTensors(
        curvature_per_mm=tensors.curvature_per_mm,
        conic=tensors.conic,
        even_asphere=torch.zeros(1, 3, dtype=torch.float64),
        thickness_mm=tensors.thickness_mm,
        semi_diameter_mm=tensors.semi_diameter_mm,
        index=tensors.index,
        aspheric=(True,),
    )
    y = torch.linspace(-9, 9, 19, dtype=torch.float64)
    rays = launch(torch.zeros_like(y), y, torch.tensor(0.1), math.inf)
    assert torch.allclose(trace(tensors, rays).y, trace(forced, rays).y, rtol=0, atol=1e-12)


def test_fates_name_what_happened() -> None:
    """A ray beside a sphere misses; in a steep exit it is reflected; beyond the rim vignetted."""
    sphere = _tensors(Surface(curvature_per_mm=1 / 5, thickness_mm=1.0, glass="N-BK7-Schott"))
    zero = torch.zeros(2, dtype=torch.float64)
    beside = trace(sphere, launch(zero, _column(0.0, 6.0), zero, math.inf))
    assert beside.fate.tolist() == [Fate.VALID, Fate.MISSED]
    exit_side = _tensors(
        Surface(curvature_per_mm=0.0, thickness_mm=2.0, glass="N-BK7-Schott"),
        Surface(curvature_per_mm=-1 / 5, thickness_mm=1.0),
    )
    steep = trace(exit_side, launch(zero, _column(1.0, 4.0), zero, math.inf))
    assert steep.fate.tolist() == [Fate.VALID, Fate.TOTAL_REFLECTION]
    rim = _tensors(Surface(curvature_per_mm=0.0, thickness_mm=1.0, semi_diameter_mm=3.0))
    cut = trace(rim, launch(zero, _column(2.9, 3.1), zero, math.inf))
    assert cut.fate.tolist() == [Fate.VALID, Fate.VIGNETTED]


def test_first_failure_is_kept() -> None:
    tensors = _tensors(
        Surface(curvature_per_mm=1 / 5, thickness_mm=1.0, glass="N-BK7-Schott"),
        Surface(curvature_per_mm=0.0, thickness_mm=1.0, semi_diameter_mm=1e-9),
    )
    y = _column(6.0)
    landed = trace(tensors, launch(torch.zeros_like(y), y, torch.zeros_like(y), math.inf))
    assert landed.fate.tolist() == [Fate.MISSED]


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000))
def test_no_lens_gives_nan_in_value_or_gradient(seed: int) -> None:
    """Wild conics and aspheres lose rays, and lost rays stay finite with zero gradients."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 6))
    tensors = SurfaceTensors(
        curvature_per_mm=torch.from_numpy(rng.uniform(-0.3, 0.3, count)).requires_grad_(),
        conic=torch.from_numpy(rng.uniform(-30, 30, count)).requires_grad_(),
        even_asphere=torch.from_numpy(rng.normal(0, 1e-3, (count, 2))).requires_grad_(),
        thickness_mm=torch.from_numpy(rng.uniform(-3, 9, count)).requires_grad_(),
        semi_diameter_mm=torch.full((count,), 12.0, dtype=torch.float64),
        index=torch.from_numpy(rng.uniform(1, 2, count + 1)).requires_grad_(),
        aspheric=tuple(bool(v) for v in rng.integers(0, 2, count)),
    )
    x, y = (torch.from_numpy(rng.uniform(-15, 15, 64)) for _ in "xy")
    slope = torch.from_numpy(rng.uniform(-1, 1, 64)).requires_grad_()
    landed = trace(tensors, launch(x, y, slope, math.inf))
    total = (landed.x**2 + landed.y**2 + landed.n).sum()
    assert bool(torch.isfinite(total))
    leaves = [
        tensors.curvature_per_mm,
        tensors.conic,
        tensors.even_asphere,
        tensors.thickness_mm,
        tensors.index,
        slope,
    ]
    grads = torch.autograd.grad(total, leaves, allow_unused=True)
    assert all(bool(torch.isfinite(g).all()) for g in grads if g is not None)


def test_gradient_of_a_lost_ray_is_zero() -> None:
    tensors = _tensors(Surface(curvature_per_mm=1 / 5, thickness_mm=9.0, glass="N-BK7-Schott"))
    y = _column(6.0).requires_grad_()
    zero = torch.zeros(1, dtype=torch.float64)
    landed = trace(tensors, launch(zero, y, zero, math.inf))
    (slope,) = torch.autograd.grad(landed.y.sum() + landed.m.sum(), y)
    assert float(slope) == 0.0
