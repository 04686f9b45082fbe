from dataclasses import replace

import torch

from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.design_recipe import DesignRecipe
from camkit.models_def.design.lens_module import whitening
from camkit.models_def.optics.search.problem import Problem, residuals


def rms_change(problem: Problem, begin: torch.Tensor, move: torch.Tensor) -> float:
    """Give how far the spots move, in pixel cores."""
    rms = replace(problem, merit="rms")
    with torch.no_grad():
        gap = residuals(rms, (begin + move)[None]) - residuals(rms, begin[None])
    return float(gap.norm()) / problem.core_mm


def test_equal_moves_change_the_spots_alike(recipe: DesignRecipe) -> None:
    problem = parts_of(recipe).lens.problem
    begin = torch.full((3,), 0.5, dtype=torch.float64)
    basis = whitening(problem, begin)
    found = [rms_change(problem, begin, 0.02 * column) / 0.02 for column in basis.T]
    assert max(found) < 1.5
    plain = torch.eye(3, dtype=torch.float64)
    spread = [rms_change(problem, begin, 0.02 * column) for column in plain]
    assert max(spread) / min(spread) > 2 * max(found) / min(found)


def test_a_number_at_its_bound_has_an_axis_of_its_own(recipe: DesignRecipe) -> None:
    problem = parts_of(recipe).lens.problem
    basis = whitening(problem, torch.tensor([0.5, 0.0, 0.5], dtype=torch.float64))
    assert float(basis[1, [0, 2]].abs().max()) < 1e-12
    assert float(basis[[0, 2], 1].abs().max()) < 1e-12
    assert abs(float(basis[0, 2])) > 1e-6


def test_a_number_beyond_its_bound_feels_only_what_leads_back(recipe: DesignRecipe) -> None:
    lens = parts_of(replace(recipe, optics=replace(recipe.optics, whiten=False))).lens
    with torch.no_grad():
        lens.moves.copy_(torch.tensor([-9.0, 9.0, 0.1]))
    for sign, felt in ((1.0, [0.0, 1.0, 1.0]), (-1.0, [-1.0, 0.0, -1.0])):
        (slope,) = torch.autograd.grad(sign * lens.scaled().sum(), lens.moves)
        assert slope.tolist() == felt


def test_numbers_stay_within_their_bounds(recipe: DesignRecipe) -> None:
    lens = parts_of(recipe).lens
    with torch.no_grad():
        lens.moves.fill_(1e6)
    assert float(lens.scaled().detach().max()) <= 1
    assert float(lens.scaled().detach().min()) >= 0


def test_a_move_in_own_units_is_one_of_the_number(recipe: DesignRecipe) -> None:
    optics = replace(recipe.optics, whiten=False, units="own")
    lens = parts_of(replace(recipe, optics=optics)).lens
    before = lens.lens().surfaces[2].conic
    with torch.no_grad():
        lens.moves[0] += 0.08
    assert abs(lens.lens().surfaces[2].conic - before - 0.08) < 1e-12


def test_depths_out_of_focus_are_not_taken_for_distorted(recipe: DesignRecipe) -> None:
    optics = replace(recipe.optics, object_distances_mm=(400.0, 1000.0), focus_distance_mm=1000.0)
    limits = replace(recipe.limits, distortion=0.05)
    near = replace(recipe, optics=optics, limits=limits)
    assert float(parts_of(near).lens()[1].detach()) < 1e-6
    # seen from 0.4 m the picture on this sensor is 8 % smaller than its image
    problem = parts_of(near).lens.problem
    assert problem.limited_mm == 1000.0
    assert problem.depths_mm == (400.0, 1000.0)
