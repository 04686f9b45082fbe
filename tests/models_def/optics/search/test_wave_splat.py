"""Wave PSFs in a design: their gradients, and those of the frozen lens."""

import math
from dataclasses import replace
from typing import Final

import pytest
import torch
from torch import Tensor

from camkit.models_def.design.lens_module import LensModule
from camkit.models_def.optics.analysis import wave_psf as wave_psf_module
from camkit.models_def.optics.analysis.lens_waves import wave_psf
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.paraxial import with_paraxial_focus
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.splat import Pixels
from camkit.models_def.optics.search.variables import FreeLens, Variable

WEIGHTS: Final = torch.eye(3, dtype=torch.float64)


def _module(
    regime: str = "waves",
    slope: float = 0.1,
    object_distance_mm: float = math.inf,
    kernel_px: int = 21,
    **medium: str,
) -> LensModule:
    lens = replace(find_lens("double-gauss"), aperture_kind="f_number", aperture_value=8.0)
    lens = replace(lens, object_distance_mm=object_distance_mm, **medium)
    lens = with_paraxial_focus(lens) if medium else lens
    front = lens.surfaces[0].curvature_per_mm
    bend = Variable(kind="curvature", surface=0, low=front - 2e-4, high=front + 2e-4)
    problem = Problem(
        free=FreeLens(lens=lens, variables=(bend,)),
        slopes=torch.tensor([0.0, slope], dtype=torch.float64),
        wavelengths_um=torch.tensor([0.48, 0.55, 0.62], dtype=torch.float64),
        samples=half_disc(200),
    )
    pixels = Pixels(pitch_um=3.76, color_weights=WEIGHTS, kernel_px=kernel_px, window_follows=True)
    chosen = replace(pixels, regime="waves" if regime == "waves" else "rays")
    return LensModule(problem, chosen, torch.full((1,), 0.5, dtype=torch.float64))


def _sharpness(module: LensModule) -> Tensor:
    kernels, _ = module()
    return kernels.square().sum()


def test_gradient_through_the_trace_is_that_of_differences() -> None:
    module, step = _module(), 1e-2
    (slope,) = torch.autograd.grad(_sharpness(module), module.moves)
    with torch.no_grad():
        module.moves += step
        high = float(_sharpness(module))
        module.moves -= 2 * step
        low = float(_sharpness(module))
    assert float(slope) == pytest.approx((high - low) / (2 * step), rel=2e-3)


def test_kernels_of_the_axis_are_those_that_are_frozen() -> None:
    module = _module()
    with torch.no_grad():
        kernels, _ = module()
        frozen = wave_psf(
            module.lens(), module.problem.slopes[:1], module.problem.wavelengths_um, 21, 3.76
        )
        by_rays, _ = _module("rays")()
    light = frozen.kernels * frozen.energy_kept[..., None, None]
    assert float((kernels[0, 0] - light[0]).abs().sum((-2, -1)).max()) < 5e-3
    assert float((by_rays[0, 0] - light[0]).abs().sum((-2, -1)).min()) > 0.2


def test_field_that_loses_rays_keeps_its_rays() -> None:
    """At 60 degrees no ray gets through; the axis has its waves all the same."""
    module = _module(slope=1.7)
    with torch.no_grad():
        kernels, _ = module()
    assert float(kernels[0, 0].sum()) > 2.8
    assert bool(torch.isfinite(kernels).all())


def test_kernels_of_an_object_in_glass_are_those_that_are_frozen() -> None:
    """The path in front of the lens counts with its index."""
    module = _module(object_glass="model:1.1,0", object_distance_mm=1000.0)
    with torch.no_grad():
        kernels, _ = module()
        problem = module.problem
        frozen = wave_psf(module.lens(), problem.slopes[:1], problem.wavelengths_um, 21, 3.76)
    light = frozen.kernels * frozen.energy_kept[..., None, None]
    assert float((kernels[0, 0] - light[0]).abs().sum((-2, -1)).max()) < 5e-3


def test_wide_window_and_wide_blur_stop_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """A window is summed as far as its rays reach; a blur beyond them keeps its rays."""
    near = {"object_distance_mm": 5e3}
    with torch.no_grad():
        whole = _module(kernel_px=41)()[0]
        monkeypatch.setattr(wave_psf_module, "MAX_WAVE_RAYS", 1500)
        kernels = _module(kernel_px=41)()[0]
        assert not torch.equal(kernels, whole)
        assert float((kernels - whole).abs().sum((-2, -1)).max()) < 0.02
        blurred = _module(**near)
        blurred.sharp[:] = True
        assert torch.equal(blurred()[0], _module("rays", **near)()[0])
