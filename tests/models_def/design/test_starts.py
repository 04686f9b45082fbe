from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.design.assembly import find_lens, parts_of, problem_of
from camkit.models_def.design.recipe import DesignRecipe, to_design
from camkit.models_def.design.starts import Starts, best_start, disturbed
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.problem import Problem, residuals, valid_share
from camkit.models_def.optics.search.variables import Variable


@pytest.fixture
def lens() -> Lens:
    return find_lens("duet")


def far_off(recipe: DesignRecipe, lens: Lens, seed: int) -> Problem:
    """Give a design of the doublet from curvatures that are off by up to a half."""
    wide = [Variable(kind="curvature", surface=i, low=-0.1, high=0.1) for i in (1, 2, 3)]
    optics = replace(recipe.optics, efl_mm=50.0, solved_surface=4)
    given = replace(recipe, variables=(*wide, *recipe.variables), optics=optics)
    rng = np.random.default_rng(seed)
    return problem_of(given, disturbed(lens, rng, curvature_share=0.5, focus_mm=2.0))


def merit(problem: Problem, scaled: torch.Tensor) -> float:
    with torch.no_grad():
        return float(residuals(problem, scaled[None]).square().sum())


def test_without_a_search_a_design_begins_at_its_lens(recipe: DesignRecipe) -> None:
    lens = parts_of(recipe).lens
    assert torch.equal(lens.begin, lens.problem.free.scaled())


def test_a_recipe_that_asks_for_starts_begins_at_the_best_of_them(table: dict[str, Any]) -> None:
    plain = parts_of(to_design(table)).lens
    table["starts"] = {"count": 4, "dls_steps": 10}
    searched = parts_of(to_design(table)).lens
    again = parts_of(to_design(table)).lens
    assert torch.equal(searched.begin, again.begin)
    assert merit(plain.problem, searched.begin) < 0.98 * merit(plain.problem, plain.begin)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_from_far_off_the_best_start_loses_no_ray_and_keeps_the_focal_length(
    recipe: DesignRecipe, lens: Lens, seed: int
) -> None:
    problem = far_off(recipe, lens, seed)
    begin = problem.free.scaled()
    found = best_start(problem, Starts(count=8))
    assert float(valid_share(problem, found[None])) == 1
    assert paraxial_data(problem.free.made(found)).efl_mm == pytest.approx(50, abs=1e-6)
    assert merit(problem, found) < 0.6 * merit(problem, begin)


def test_more_starts_are_never_worse_than_the_given_one_alone(
    recipe: DesignRecipe, lens: Lens
) -> None:
    problem = far_off(recipe, lens, 4)
    alone = best_start(problem, Starts(count=1, scout_steps=0, dls_steps=0))
    torch.testing.assert_close(alone, problem.free.scaled(), rtol=0, atol=0)
    some = best_start(problem, Starts(count=6, scout_steps=2, dls_steps=2))
    assert merit(problem, some) <= merit(problem, alone)


def test_a_disturbed_lens_is_off_by_no_more_than_asked(lens: Lens) -> None:
    drawn = [
        disturbed(lens, np.random.default_rng(i), curvature_share=0.1, focus_mm=2.0)
        for i in range(40)
    ]
    pairs = [(s, t) for d in drawn for s, t in zip(d.surfaces, lens.surfaces, strict=True)]
    bent = [s.curvature_per_mm / t.curvature_per_mm - 1 for s, t in pairs if t.curvature_per_mm]
    assert 0.09 < max(abs(b) for b in bent) <= 0.1
    moved = [d.surfaces[-1].thickness_mm - lens.surfaces[-1].thickness_mm for d in drawn]
    assert 1.7 < max(abs(m) for m in moved) <= 2.0
    inner = {tuple(s.thickness_mm for s in d.surfaces[:-1]) for d in drawn}
    assert inner == {tuple(s.thickness_mm for s in lens.surfaces[:-1])}


@pytest.mark.parametrize("entry", [{"count": -1}, {"spread": 1.5}, {"dls_steps": -1}])
def test_wrong_starts_are_refused(table: dict[str, Any], entry: dict[str, Any]) -> None:
    table["starts"] = entry
    with pytest.raises(ContractError, match="counts >= 0"):
        to_design(table)
