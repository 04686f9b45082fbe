"""Odd, normalised and Q polynomials and phases: adjoint, blocks, compiled loop."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from camkit.models_def.optics.trace import SurfaceTensors, trace
from camkit.models_def.optics.tracing import compilation
from camkit.models_def.optics.tracing.phase_polynomial import PhaseForm
from camkit.models_def.optics.tracing.series import Series
from tests.physics.printed_lenses import cooke_tensors, rays_at

EQUAL = 1e-9
FLOAT32_EQUAL = 2e-4
LEAVES = (
    *("curvature_per_mm", "conic", "even_asphere", "thickness_mm", "index"),
    *("odd_asphere", "phase"),
)
FORM = PhaseForm(radius_mm=6.0, radial=2, powers=((3, 0), (1, 2), (0, 1)))


def _lens(dtype: torch.dtype = torch.float64) -> SurfaceTensors:
    """A Cooke triplet with every kind of polynomial part, and two phases at three wavelengths."""
    lens = cooke_tensors(torch.float64, conic=-0.4)
    even = torch.tensor([[2e-3, -5e-3, 1e-3, 4e-4]], dtype=torch.float64).repeat(6, 1)
    even[3] = 0.0
    even[4] = torch.tensor([1e-5, 2e-6, -3e-8, 1e-10])
    odd = torch.tensor([[3e-3, -2e-3, 1e-3]], dtype=torch.float64).repeat(6, 1)
    radial = torch.tensor([-40.0, 6.0, 5.0, -3.0, 8.0], dtype=torch.float64)
    orders = torch.zeros(6, 3, 1, dtype=torch.float64)
    orders[[1, 5]] = torch.tensor([0.45e-3, 0.55e-3, 0.65e-3])[:, None].double() / 6.2832
    shift = torch.tensor([0.0, 0.01, 0.02], dtype=torch.float64)[:, None]
    return replace(
        lens,
        index=lens.index[:, None, None] + shift * (lens.index > 1)[:, None, None],
        even_asphere=even,
        odd_asphere=odd,
        aspheric=(True, True, True, False, True, True),
        series=(
            Series(radius_mm=7.0),
            Series(radius_mm=5.0, odd=True),
            Series(radius_mm=8.0, over_root=True),
            None,
            None,
            Series(radius_mm=9.0, odd=True),
        ),
        phase=radial.repeat(6, 1),
        order_mm=orders,
        phases=(None, FORM, None, None, None, FORM),
    ).converted(dtype)


def _phase(lens: SurfaceTensors, i: int, x: Tensor, y: Tensor) -> Tensor:
    form, a = lens.phases[i], lens.phase
    assert form is not None
    assert a is not None
    u, v = x / form.radius_mm, y / form.radius_mm
    total = sum(a[i, j] * (u**2 + v**2) ** (j + 1) for j in range(form.radial))
    free = zip(form.powers, range(form.radial, len(a[i])), strict=True)
    return total + sum(a[i, j] * u**p * v**q for (p, q), j in free)


def _slow_trace(lens: SurfaceTensors, x: Tensor, y: Tensor, slope: Tensor) -> tuple[Tensor, ...]:
    """Newton's method in the graph, phases by autograd, the grating equation in vectors."""
    n = 1 / torch.sqrt(1 + slope**2)
    shape = torch.broadcast_shapes(x.shape, lens.index.shape[1:])
    place = [v.expand(shape) for v in (x, y, 0 * x)]
    direction = [v.expand(shape) for v in (0 * x, slope * n, n + 0 * x)]
    path = torch.zeros(shape, dtype=x.dtype)
    for i in range(len(lens.aspheric)):
        way = -place[2] / direction[2]
        for _ in range(40):
            hit = [p + way * d for p, d in zip(place, direction, strict=True)]
            rho = hit[0] ** 2 + hit[1] ** 2
            lean = 2 * lens.slope(i, rho)
            facing = direction[2] - lean * (hit[0] * direction[0] + hit[1] * direction[1])
            way = way + (lens.height(i, rho) - hit[2]) / facing
        path = path + lens.index[i] * way
        place = [p + way * d for p, d in zip(place, direction, strict=True)]
        rho = place[0] ** 2 + place[1] ** 2
        lean = 2 * lens.slope(i, rho)
        normal = torch.stack([-lean * place[0], -lean * place[1], torch.ones_like(lean)])
        normal = normal / normal.norm(dim=0)
        before, after = lens.index[i], lens.index[i + 1]
        optical = [before * d for d in direction]
        if lens.phases and lens.phases[i] is not None:
            assert lens.order_mm is not None
            phi = _phase(lens, i, place[0], place[1])
            slopes = torch.autograd.grad(phi.sum(), place[:2], create_graph=True)
            optical = [
                v + lens.order_mm[i] * s for v, s in zip(optical, (*slopes, 0.0), strict=True)
            ]
            path = path + lens.order_mm[i] * phi
        along = (normal * torch.stack(optical)).sum(0)
        square = (torch.stack(optical) ** 2).sum(0)
        turn = torch.sqrt(after**2 - square + along**2) - along
        direction = [(v + turn * w) / after for v, w in zip(optical, normal, strict=True)]
        place[2] = place[2] - lens.thickness_mm[i]
    way = -place[2] / direction[2]
    path = path + lens.index[-1] * way
    return (*(p + way * d for p, d in zip(place[:2], direction[:2], strict=True)), *direction, path)


def _loss(outputs: tuple[Tensor, ...]) -> Tensor:
    x, y, l, m, n, path = outputs  # noqa: E741
    return (x**2 + 3 * y**2 + x * y * l + (m - 0.1) ** 2 + n * y + path * (1 + 0.1 * y)).sum()


def _free(lens: SurfaceTensors) -> tuple[SurfaceTensors, list[Tensor]]:
    leaves = {name: getattr(lens, name).detach().clone().requires_grad_() for name in LEAVES}
    return replace(lens, **leaves), list(leaves.values())


def _traced(lens: SurfaceTensors, start: list[Tensor], *, compiled: bool) -> tuple[Tensor, ...]:
    x, y, slope = start
    n = 1 / torch.sqrt(1 + slope**2)
    rays = replace(rays_at(x, y, 0.0), m=slope * n, n=n)
    end = trace(lens, rays, path=True, compiled=compiled)
    assert bool(end.valid.all())
    assert end.path_mm is not None
    return (end.x, end.y, end.l, end.m, end.n, end.path_mm)


def _start(dtype: torch.dtype = torch.float64) -> list[Tensor]:
    x = torch.linspace(-3, 2.5, 7, dtype=dtype)
    y = torch.linspace(-4, 3, 7, dtype=dtype) - 1.0
    return [v.requires_grad_() for v in (x, y, torch.full_like(x, 0.1))]


def test_adjoint_equals_autograd_of_an_unrolled_trace() -> None:
    """By rays and by every number of the lens, with the optical path."""
    start = _start()
    free, leaves = _free(_lens())
    found, slow = _traced(free, start, compiled=False), _slow_trace(free, *start)
    for a, b in zip(found, slow, strict=True):
        assert float((a - b).detach().abs().max()) < EQUAL
    every = [*start, *leaves]
    wanted = torch.autograd.grad(_loss(slow), every)
    grads = torch.autograd.grad(_loss(found), every)
    for g, w in zip(grads, wanted, strict=True):
        assert float(w.abs().max()) > 0
        assert float((g - w).abs().max()) < EQUAL * float(w.abs().max())


def test_float32_gradients_agree_with_float64() -> None:
    grads = []
    for dtype in (torch.float64, torch.float32):
        free, leaves = _free(_lens(dtype))
        grads.append(
            torch.autograd.grad(_loss(_traced(free, _start(dtype), compiled=False)), leaves)
        )
    for a, b in zip(*grads, strict=True):
        assert float((a - b).abs().max()) < FLOAT32_EQUAL * 10 * float(a.abs().max())


def test_fused_engine_equals_the_plain_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "compile", lambda function, **_: function)
    monkeypatch.setattr(compilation, "compiler_fault", lambda: None)
    monkeypatch.setattr("camkit.models_def.optics.tracing.gradient.KEEP_BYTES", 0)
    compilation._forward.cache_clear()
    compilation._backward.cache_clear()
    results = []
    for compiled in (True, False):
        start = _start()
        free, leaves = _free(_lens())
        found = _traced(free, start, compiled=compiled)
        results.append([*found, *torch.autograd.grad(_loss(found), [*start, *leaves])])
    compilation._forward.cache_clear()
    compilation._backward.cache_clear()
    for a, b in zip(*results, strict=True):
        assert float((a - b).detach().abs().max()) < EQUAL * max(1.0, float(b.detach().abs().max()))


@pytest.mark.slow
def test_compiled_trace_equals_the_plain_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("camkit.models_def.optics.tracing.gradient.KEEP_BYTES", 0)
    results = []
    for compiled in (True, False):
        start = _start(torch.float32)
        free, leaves = _free(_lens(torch.float32))
        found = _traced(free, start, compiled=compiled)
        results.append([*found, *torch.autograd.grad(_loss(found), [*start, *leaves])])
    for a, b in zip(*results, strict=True):
        assert float((a - b).detach().abs().max()) < 1e-3 * max(1.0, float(b.detach().abs().max()))
