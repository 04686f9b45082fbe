"""What the rims of a lens cut, and what it is already, costs a search nothing."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.models_def.optics.prescription import Lens, read_prescription
from camkit.models_def.optics.pupil import half_disc, hexapolar
from camkit.models_def.optics.search.beam_launch import LEAD
from camkit.models_def.optics.search.improvement import free_lens, refracting_surfaces
from camkit.models_def.optics.search.limits import Limits
from camkit.models_def.optics.search.own_frame import in_own_frame, too_small_rims
from camkit.models_def.optics.search.problem import Problem, limits_of, residuals, trace_batch
from camkit.models_def.optics.spot import trace_spots

PRESCRIPTIONS = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions"


def triplet(*rims_mm: float) -> Lens:
    lens = read_prescription(PRESCRIPTIONS / "cooke-triplet-f5.toml")
    rims = {0: rims_mm[0], len(lens.surfaces) - 1: rims_mm[1]} if rims_mm else {}
    return replace(
        lens,
        surfaces=tuple(
            replace(s, semi_diameter_mm=rims.get(i, math.inf)) for i, s in enumerate(lens.surfaces)
        ),
    )


def problem_of(lens: Lens, **more: object) -> Problem:
    refracting = refracting_surfaces(lens)
    free = [("curvature",) if i in refracting else () for i in range(len(lens.surfaces))]
    return Problem(
        free=free_lens(lens, free),  # type: ignore[arg-type]
        slopes=torch.tan(torch.tensor(lens.field_angles_rad, dtype=torch.float64)),
        wavelengths_um=torch.tensor([0.48, 0.55, 0.65], dtype=torch.float64),
        samples=half_disc(200),
        **more,  # type: ignore[arg-type]
    )


def test_without_rims_the_whole_pupil_counts() -> None:
    problem = problem_of(triplet())
    framed = in_own_frame(problem, problem.free.scaled())
    assert framed.vignetting is None
    assert framed.limits == problem.limits


def test_vignetting_factors_are_those_of_rays_that_pass_the_rims() -> None:
    lens = triplet(6.0, 6.0)
    problem = problem_of(lens)
    begin = problem.free.scaled()
    framed = in_own_frame(problem, begin)
    assert framed.vignetting is not None
    # all that is left passes, and it is as much as the tracer with rims lets through
    seen = trace_batch(framed, begin[None], math.inf).surface_rays
    for i in (0, len(lens.surfaces) - 1):
        reach = torch.hypot(seen[i].x, seen[i].y)[..., LEAD:]
        assert float(reach.max()) < 6.0 * 1.05, "an ellipse is a little more than what passes"
    arriving = trace_spots(
        lens, problem.slopes, problem.wavelengths_um, hexapolar(20), definition="paraxial"
    )
    share = (arriving.fate == 0).double().mean((1, 2))
    area = framed.vignetting[:, 1] * framed.vignetting[:, 2]
    torch.testing.assert_close(area, share, atol=0.06, rtol=0)  # an ellipse for a lens
    assert float(area[0]) == 1.0
    assert float(area[-1]) < 0.8


def test_a_lens_pays_nothing_for_what_it_is() -> None:
    lens = triplet(6.0, 6.0)
    strict = Limits(min_edge_mm=5.0, min_air_mm=4.0, min_bfl_mm=60.0, max_curvature_per_mm=1.0)
    problem = problem_of(lens, limits=strict)
    begin = problem.free.scaled()

    def cost(given: Problem) -> float:
        traced = trace_batch(given, begin[None], math.inf)
        return float(limits_of(given, traced, math.inf).square().sum())

    assert cost(problem) > 1
    framed = in_own_frame(problem, begin)
    assert cost(framed) == pytest.approx(0, abs=1e-6)
    assert float(residuals(framed, begin[None]).square().sum()) < 0.05


def test_a_rim_that_the_beam_outgrows_is_named() -> None:
    problem = problem_of(triplet(6.0, 30.0))
    begin = problem.free.scaled()
    assert [i for i, _, _ in too_small_rims(problem, begin)] == [0]
    (_, reach_mm, rim_mm), *_ = too_small_rims(problem, begin)
    assert reach_mm > rim_mm == 6.0
    assert too_small_rims(in_own_frame(problem, begin), begin) == []


def test_a_steep_lens_pays_nothing_for_what_it_is() -> None:
    problem = problem_of(triplet(), limits=Limits(max_steepness=0.1, max_curvature_per_mm=1.0))
    begin = problem.free.scaled()
    for each, expected in ((problem, False), (in_own_frame(problem, begin), True)):
        traced = trace_batch(each, begin[None], math.inf)
        paid = float(limits_of(each, traced, math.inf).square().sum())
        assert (paid < 1e-20) is expected
