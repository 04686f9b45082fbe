"""Wave PSFs of a lens in a search, differentiable, in the colours of a sensor.

As `splat` is for rays: the pupil is the paraxial entrance pupil, evenly lit.
"""

import math
from dataclasses import replace
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.start import path_before, with_open_apertures
from camkit.models_def.optics.analysis.pupil_fit import FIT_GRIDS, half_quadrature
from camkit.models_def.optics.analysis.wave_kernels import (
    CoarsePupil,
    rim_margins,
    summed_light,
    wave_side_px,
)
from camkit.models_def.optics.analysis.wavefront import to_sphere
from camkit.models_def.optics.search.beam_launch import LEAD
from camkit.models_def.optics.search.problem import Change, Problem, trace_batch
from camkit.models_def.optics.search.splat import Pixels
from camkit.models_def.optics.trace import Rays, SurfaceTensors
from camkit.units import UM_PER_MM

GRID: Final = FIT_GRIDS[1]


def wave_problem(problem: Problem) -> Problem:
    """Return the problem with the rays that waves are interpolated from."""
    return replace(problem, samples=half_quadrature(GRID.rings, GRID.arms))


def wave_batch(
    problem: Problem,
    scaled: Tensor,
    object_distance_mm: float,
    pixels: Pixels,
    fields: Tensor,
    change: Change | None = None,
) -> tuple[Tensor, Tensor]:
    """Return kernels (field, colour, k, k) of a lens by waves, and the fields that have them.

    A field that loses a ray, has too wide a blur, or is not wanted, has none: its kernels are 0.

    Args:
        problem: Of `wave_problem`.
        scaled: (1, variable), the lens.
        object_distance_mm: Of the object.
        pixels: The sensor; kernels lie about the centroid of all colours, as those of `splat`.
        fields: (field,), which of them are wanted.
        change: See `trace_batch`.
    """
    rims: list[Tensor] = []

    def opened(tensors: SurfaceTensors, reference: SurfaceTensors) -> SurfaceTensors:
        changed = tensors if change is None else change(tensors, reference)
        rims.append(changed.semi_diameter_mm)
        return with_open_apertures(changed)

    traced = trace_batch(problem, scaled, object_distance_mm, opened, path=True)
    rays, landings, weight = traced.launched, traced.landings, problem.samples.weight
    if landings.path_mm is None or weight is None:
        raise ContractError("waves need optical paths and the rays of wave_problem")
    slope = problem.slopes[:, None, None]
    start_path = path_before(rays, slope, object_distance_mm, traced.tensors.index[0])
    path = landings.path_mm + start_path
    share = weight / weight.sum() / len(problem.wavelengths_um)
    middle = (landings.y[..., LEAD:] * share).sum((-2, -1), keepdim=True)
    if not pixels.window_follows:
        middle = middle.detach()
    # any sphere will do: this one has the directions of the rays, as if the exit pupil were far
    sphere = to_sphere(landings, path, middle, math.inf, traced.tensors.index[-1])
    alive = fields & _pupil(landings.valid).flatten(1).all(-1)
    along_x = _pupil(sphere.l)
    coarse = CoarsePupil(
        grid=GRID,
        l=along_x,
        m=_pupil(sphere.m),
        opd_um=_pupil((sphere.path[..., :1] - sphere.path) * UM_PER_MM),
        area=torch.ones_like(along_x),
        margins=rim_margins([_pupil_rays(r) for r in traced.surface_rays], _of_one(rims[0])),
        miss_mm=_pupil(sphere.miss_mm),
        wavelengths_um=problem.wavelengths_um,
    )
    side, pitch_um = pixels.kernel_px, pixels.pitch_um
    for i in torch.nonzero(alive).flatten().tolist():
        waves = range(len(problem.wavelengths_um))
        alive[i] = all(wave_side_px(coarse, i, j, side, pitch_um) for j in waves)
    kernels = torch.zeros(len(alive), 3, side, side, dtype=torch.float64)
    if bool(alive.any()):
        light = summed_light(_of_fields(coarse, alive), side, pitch_um)
        colours = torch.einsum("cw,fwyx->fcyx", pixels.color_weights.to(light.dtype), light)
        kernels = kernels.index_put((alive,), colours)
    return kernels, alive


def _pupil(values: Tensor) -> Tensor:
    """Return (field, wavelength, ray) of the rays that fill the pupil."""
    return values[0, ..., LEAD:]


def _pupil_rays(rays: Rays) -> Rays:
    return replace(rays, x=_pupil(rays.x), y=_pupil(rays.y))


def _of_one(semi_diameter_mm: Tensor) -> Tensor:
    return semi_diameter_mm.reshape(len(semi_diameter_mm), 1, 1, 1)


def _of_fields(coarse: CoarsePupil, fields: Tensor) -> CoarsePupil:
    return replace(
        coarse,
        l=coarse.l[fields],
        m=coarse.m[fields],
        opd_um=coarse.opd_um[fields],
        area=coarse.area[fields],
        margins=coarse.margins[:, fields],
        miss_mm=coarse.miss_mm[fields],
    )
