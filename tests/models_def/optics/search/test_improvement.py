from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.finish import finished
from camkit.models_def.optics.search.improvement import free_lens, improve, refracting_surfaces
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.spot_residuals import MERITS, Merit


@pytest.mark.parametrize("merit", MERITS)
def test_a_defocused_lens_is_brought_back(merit: Merit, problem: Problem) -> None:
    given = replace(problem, merit=merit, core_mm=0.03)
    begin = given.free.scaled()
    begin[-1] = 0.9
    found = improve(given, begin, starts=4, scout_steps=2, steps=12)
    assert found.merit < 0.5 * found.merit_before
    assert found.merits[0] == found.merit


def test_all_depths_count(near_problem: Problem) -> None:
    """The best focus for two depths lies between the best ones of each."""
    begin = near_problem.free.scaled()
    only = [v for v in near_problem.free.variables if v.kind == "defocus"]
    free = replace(near_problem.free, variables=tuple(only), solved=None, efl_mm=None)
    places = []
    for depths in ((1000.0,), (1000.0, 700.0), (700.0,)):
        given = replace(near_problem, free=free, object_distances_mm=depths)
        found = improve(given, begin[-1:], starts=1, steps=20)
        places.append(float(free.lens_at(found.scaled).surfaces[-1].thickness_mm))
    assert places[0] < places[1] < places[2]


def test_what_varies_is_free_and_the_last_curvature_solved(lens: Lens) -> None:
    free = free_lens(lens, [("curvature", "conic")] * 6)
    assert free.solved == 5
    assert free.efl_mm == pytest.approx(paraxial_data(lens).efl_mm)
    kinds = [v.kind for v in free.variables]
    assert kinds.count("curvature") == 5
    assert kinds.count("conic") == 6
    assert kinds[-1] == "defocus"


def test_aspheric_terms_leave_the_power_alone(lens: Lens) -> None:
    free = free_lens(lens, [("even_asphere",), *[()] * 5])
    assert all(v.term >= 1 for v in free.variables if v.kind == "even_asphere")
    scaled = free.scaled()
    scaled[0] = 1.0
    assert paraxial_data(free.lens_at(scaled)).efl_mm == pytest.approx(paraxial_data(lens).efl_mm)


def test_nothing_free_is_an_error_that_says_what_to_do(lens: Lens) -> None:
    with pytest.raises(ContractError, match="vary"):
        free_lens(lens, [()] * 6)


def test_a_stop_in_air_refracts_nothing(lens: Lens) -> None:
    stop = replace(lens.surfaces[0], curvature_per_mm=0.0, glass="air")
    behind = replace(lens, surfaces=(stop, *lens.surfaces), stop=0)
    assert refracting_surfaces(behind) == tuple(range(1, 7))


def test_a_finished_lens_passes_every_ray(problem: Problem) -> None:
    from camkit.models_def.optics.pupil import half_disc
    from camkit.models_def.optics.spot import trace_spots

    lens = finished(problem, problem.free.scaled())
    spots = trace_spots(
        lens, problem.slopes, problem.wavelengths_um, half_disc(300), definition="paraxial"
    )
    assert bool((spots.fate == 0).all())
    assert torch.tensor([s.semi_diameter_mm for s in lens.surfaces]).isfinite().all()
