"""A given lens as the frame of its own improvement: its rims, and limits no stricter than it keeps.

What a rim of the lens cuts from the beam of a field is left out by vignetting factors: the pupil of
that field is moved and squeezed until all of it passes the given lens, and stays so while the lens
moves. So a search gains nothing by vignetting more, and pays for nothing that is cut anyway.
"""

import math
from dataclasses import replace
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.pupil import PupilSamples
from camkit.models_def.optics.search.limits import steepness
from camkit.models_def.optics.search.penalty import edge_gaps, reach_rho
from camkit.models_def.optics.search.problem import Problem, trace_batch

_LINE: Final = 161
_TOUCH: Final = 1e-9


def in_own_frame(problem: Problem, scaled: Tensor) -> Problem:
    """Return the problem with the vignetting of a lens (variable,), and limits that it keeps."""
    with torch.no_grad():
        framed = replace(problem, vignetting=_vignetting(problem, scaled))
        traced = trace_batch(framed, scaled[None], framed.limited_mm)
        rho = [reach_rho(rays, traced.tensors.thickness_mm[0]) for rays in traced.surface_rays]
        edges = edge_gaps(traced.tensors, rho)[..., 0, 0, 0].amin(1).tolist()
        curvature = traced.tensors.curvature_per_mm[..., 0, 0, 0]
        steepest = float(steepness(curvature, rho).max())
        back_mm = float(traced.tensors.thickness_mm[-1].min())
    lens, limits = problem.free.lens, problem.limits
    glass = [surface.glass != "air" for surface in lens.surfaces]
    inside = [edge for edge, solid in zip(edges, glass, strict=False) if solid]
    # of two faces of glass only: a stop may stand where a surface bulges through it
    gaps_mm = [
        e for i, e in enumerate(edges) if i and not glass[i] and glass[i - 1] and glass[i + 1]
    ]
    return replace(
        framed,
        limits=replace(
            limits,
            min_edge_mm=min([limits.min_edge_mm, *inside]),
            min_air_mm=min([limits.min_air_mm, *gaps_mm]),
            min_bfl_mm=min(limits.min_bfl_mm, back_mm),
            max_steepness=max(limits.max_steepness, steepest),
        ),
    )


def too_small_rims(problem: Problem, scaled: Tensor) -> list[tuple[int, float, float]]:
    """Return (surface, reach, rim) in mm where a lens's beam needs more than the rim it has."""
    reaches = _reaches(problem, scaled)
    small_rims = []
    for i, surface in enumerate(problem.free.lens.surfaces):
        rim_mm = surface.semi_diameter_mm
        if i != problem.free.lens.stop and reaches[i] > rim_mm * (1 + _TOUCH):
            small_rims.append((i, reaches[i], rim_mm))
    return small_rims


def _reaches(problem: Problem, scaled: Tensor) -> list[float]:
    """Return the largest height of the beam on every surface, in mm."""
    rim = torch.linspace(-1, 1, _LINE, dtype=torch.float64)
    samples = PupilSamples(x=torch.zeros_like(rim), y=rim)
    with torch.no_grad():
        surface_rays = [
            trace_batch(replace(problem, samples=samples), scaled[None], depth_mm).surface_rays
            for depth_mm in problem.depths_mm
        ]
    surfaces = range(len(problem.free.lens.surfaces))
    return [
        max(
            float(torch.where(s[i].valid, torch.hypot(s[i].x, s[i].y), 0).max())
            for s in surface_rays
        )
        for i in surfaces
    ]


def _vignetting(problem: Problem, scaled: Tensor) -> Tensor | None:
    """Return (field, 3): shift along y, and squeeze along y and x, in radii of the pupil."""
    lens = problem.free.lens
    rims = [s.semi_diameter_mm if i != lens.stop else math.inf for i, s in enumerate(lens.surfaces)]
    if not any(map(math.isfinite, rims)):
        return None
    line = torch.linspace(-1, 1, _LINE, dtype=torch.float64)
    horizontal = PupilSamples(x=torch.zeros_like(line), y=line)
    low, high = _passing(problem, scaled, horizontal, rims)
    centre, half = (low + high) / 2, (high - low) / 2
    shifted = torch.stack([centre, half, torch.ones_like(half)], dim=1)
    horizontal = PupilSamples(x=line, y=torch.zeros_like(line))
    # at the height that the passing part has its middle at
    left, right = _passing(replace(problem, vignetting=shifted), scaled, horizontal, rims)
    return torch.stack([centre, half, torch.minimum(-left, right)], dim=1)


def _passing(
    problem: Problem, scaled: Tensor, samples: PupilSamples, rims: list[float]
) -> tuple[Tensor, Tensor]:
    """Return the ends (field,) of the part of a line over the pupil that all rims pass."""
    passes = torch.ones(len(problem.slopes), len(samples.x), dtype=torch.bool)
    for depth_mm in problem.depths_mm:
        traced = trace_batch(replace(problem, samples=samples), scaled[None], depth_mm)
        for rays, rim_mm in zip(traced.surface_rays, rims, strict=True):
            inside = rays.valid & (torch.hypot(rays.x, rays.y) <= rim_mm)
            passes &= inside[0, :, :, -len(samples.x) :].all(1)
    places = samples.x + samples.y
    low = torch.where(passes, places, math.inf).amin(1)
    high = torch.where(passes, places, -math.inf).amax(1)
    # a field that nothing passes keeps its whole pupil: the search then sees that it is lost
    dark = ~passes.any(1)
    return torch.where(dark, -1.0, low), torch.where(dark, 1.0, high)
