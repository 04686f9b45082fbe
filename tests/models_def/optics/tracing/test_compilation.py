import logging
from dataclasses import replace

import pytest
import torch

from camkit.models_def.optics.trace import SurfaceTensors, trace
from camkit.models_def.optics.tracing import compilation
from camkit.models_def.optics.tracing.groove import Groove
from tests.physics.printed_lenses import cooke_tensors, rays_at

FLOAT64_EQUAL = 1e-11
FLOAT32_EQUAL_MM = 2e-5
FLOAT32_GRADIENT = 1e-3


def _both(lens: SurfaceTensors, *, compiled: bool) -> tuple[torch.Tensor, ...]:
    free = {
        name: getattr(lens, name).clone().requires_grad_()
        for name in ("curvature_per_mm", "conic", "even_asphere", "index")
    }
    x = torch.linspace(-4, 4, 501, dtype=lens.conic.dtype)
    start = (0.3 * x).requires_grad_()
    landed = trace(replace(lens, **free), rays_at(start, x - 1, 0.1), path=True, compiled=compiled)
    assert landed.path_mm is not None
    (landed.y**2 + landed.x * landed.l + 0.01 * landed.path_mm).sum().backward()
    grads = [v.grad for v in (start, *free.values())]
    return (landed.y.detach(), landed.path_mm.detach(), landed.fate, *grads)


def _with_wavelengths(lens: SurfaceTensors) -> SurfaceTensors:
    shift = torch.tensor([0.0, 0.01, 0.02], dtype=lens.index.dtype)[:, None]
    index = lens.index[:, None, None] + shift * (lens.index > 1)[:, None, None]
    rims = torch.full((6,), 4.2, dtype=lens.index.dtype)
    return replace(lens, index=index, semi_diameter_mm=rims)


@pytest.mark.parametrize("r4", [0.0, 1e-7, 3e-4])
def test_fused_engine_equals_the_plain_one(r4: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its sorting of wavelengths into loops, and the way out for rays that converge slowly."""
    monkeypatch.setattr(torch, "compile", lambda function, **_: function)
    monkeypatch.setattr(compilation, "compiler_fault", lambda: None)
    compilation._forward.cache_clear()
    compilation._backward.cache_clear()
    lens = _with_wavelengths(cooke_tensors(conic=-0.3, r4=r4))
    found, wanted = (_both(lens, compiled=c) for c in (True, False))
    compilation._forward.cache_clear()
    compilation._backward.cache_clear()
    assert torch.equal(found[2], wanted[2])
    for a, b in zip(found, wanted, strict=True):
        if a.numel() and a.dtype != torch.int8:
            assert float((a - b).abs().max()) < FLOAT64_EQUAL * max(1.0, float(b.abs().max()))


def test_fused_engine_meets_grooves_as_the_plain_one_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "compile", lambda function, **_: function)
    monkeypatch.setattr(compilation, "compiler_fault", lambda: None)
    compilation._forward.cache_clear()
    compilation._backward.cache_clear()
    lens = cooke_tensors(conic=-0.3, r4=1e-7)
    groove = Groove(depth_mm=0.1, walls=True, tool_radius_mm=0.01, solid_after=True)
    lens = replace(lens, aspheric=(True,) * 6, grooves=(groove, *(None,) * 5))
    found, wanted = (_both(lens, compiled=c) for c in (True, False))
    compilation._forward.cache_clear()
    compilation._backward.cache_clear()
    assert torch.equal(found[2], wanted[2])
    assert len(set(wanted[2].tolist())) > 1
    for a, b in zip(found, wanted, strict=True):
        if a.numel() and a.dtype != torch.int8:
            assert float((a - b).abs().max()) < FLOAT64_EQUAL * max(1.0, float(b.abs().max()))


def test_without_a_compiler_the_plain_trace_runs_and_says_so(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(compilation.shutil, "which", lambda _: None)
    compilation.compiler_fault.cache_clear()
    x = torch.linspace(-4, 4, 11)
    with caplog.at_level(logging.WARNING):
        landed = trace(cooke_tensors(torch.float32), rays_at(x, x, 0.1), compiled=True)
    compilation.compiler_fault.cache_clear()
    plain = trace(cooke_tensors(torch.float32), rays_at(x, x, 0.1))
    assert torch.equal(landed.y, plain.y)
    assert "no C++ compiler" in caplog.text


@pytest.mark.slow
# torch itself uses what it deprecates
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("r4", [0.0, 1e-7])
def test_compiled_trace_equals_the_plain_one(r4: float) -> None:
    lens = cooke_tensors(torch.float32, conic=-0.1, r4=r4)
    found, wanted = (_both(lens, compiled=c) for c in (True, False))
    assert torch.equal(found[2], wanted[2])
    assert float((found[0] - wanted[0]).abs().max()) < FLOAT32_EQUAL_MM
    for a, b in zip(found[3:], wanted[3:], strict=True):
        if a.numel():
            assert float((a - b).abs().max()) < FLOAT32_GRADIENT * float(b.abs().max())
