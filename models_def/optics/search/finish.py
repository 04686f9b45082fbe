"""A found lens made into a prescription: apertures that pass its light."""

from dataclasses import replace
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.joint_states import JointProblem
from camkit.models_def.optics.search.problem import Problem, trace_batch

_CLEARANCE_MM: Final = 0.5
_RIM_RAYS: Final = 41


def finished_states(joint: JointProblem, scaled: Tensor) -> Lens:
    """Return a found lens with its configurations; its rims pass the light of all that count."""
    lens = joint.lens_at(scaled)
    ends = [finished(term.problem, scaled[term.places]).surfaces for term in joint.terms]
    rims_mm = [max(s.semi_diameter_mm for s in of_states) for of_states in zip(*ends, strict=True)]
    surfaces = tuple(
        replace(surface, semi_diameter_mm=rim_mm)
        for surface, rim_mm in zip(lens.surfaces, rims_mm, strict=True)
    )
    return replace(lens, surfaces=surfaces)


def finished(problem: Problem, scaled: Tensor) -> Lens:
    """Return a found lens (variable,) with semi-diameters that pass every ray of the fields.

    The stop keeps its own size: it limits the beam.
    """
    lens = problem.free.lens_at(scaled)
    rim = torch.linspace(-1, 1, _RIM_RAYS, dtype=torch.float64)
    samples = replace(problem.samples, x=torch.zeros_like(rim), y=rim, weight=None)
    with torch.no_grad():
        surface_rays = [
            trace_batch(replace(problem, samples=samples), scaled[None], d).surface_rays
            for d in problem.depths_mm
        ]
    surfaces = []
    for i, surface in enumerate(lens.surfaces):
        reach = max(float(torch.hypot(s[i].x, s[i].y).max()) for s in surface_rays)
        semi_mm = round(reach + _CLEARANCE_MM, 1)
        if i == lens.stop:
            semi_mm = (
                reach if lens.aperture_kind != "stop_semi_diameter_mm" else lens.aperture_value
            )
        surfaces.append(replace(surface, semi_diameter_mm=semi_mm))
    return replace(lens, surfaces=tuple(surfaces))
