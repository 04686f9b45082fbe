from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.design.assembly import parts_of, problem_of
from camkit.models_def.design.design_recipe import DesignRecipe, to_design, with_choices
from camkit.models_def.design.loop import DesignLoop, DesignParts
from camkit.models_def.design.starts import (
    Starts,
    best_judged,
    best_starts,
)
from camkit.models_def.optics.lens_file.lens_file import find_lens
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
    factors = 1 + rng.uniform(-0.5, 0.5, len(lens.surfaces))
    *surfaces, last = (
        replace(s, curvature_per_mm=s.curvature_per_mm * float(factor))
        for s, factor in zip(lens.surfaces, factors, strict=True)
    )
    last = replace(last, thickness_mm=last.thickness_mm + float(rng.uniform(-2.0, 2.0)))
    return problem_of(given, replace(lens, surfaces=(*surfaces, last)))


def merit(problem: Problem, scaled: torch.Tensor) -> float:
    with torch.no_grad():
        return float(residuals(problem, scaled[None]).square().sum())


def test_without_a_search_a_design_begins_at_its_lens(recipe: DesignRecipe) -> None:
    lens = parts_of(recipe).lens
    assert torch.equal(lens.begin, lens.problem.free.scaled())


def test_a_search_at_one_depth_finds_the_lens_that_a_plate_then_blurs(
    table: dict[str, Any],
) -> None:
    """The plate stays as the recipe adds it, its coefficients where they began."""
    plate = {"surface": 0, "radius_mm": 6.25, "free_rad": {"x3": 40.0, "y3": 40.0}}
    free = [{"kind": "phase", "surface": 0, "term": i, "low": 0.0, "high": 80.0} for i in (0, 1)]
    table |= {"phase": [plate], "vary": [free[0], *table["vary"], free[1]]}
    table["optics"] |= {"object_distances_mm": [1000.0, 2000.0], "azimuths_deg": [0.0, 180.0]}
    table["starts"] = {"count": 4, "dls_steps": 10, "depth_mm": 1500.0}
    lens = parts_of(to_design(table)).lens
    plain = lens.problem.free.scaled()
    assert lens.begin[[0, -1]].tolist() == [0.5, 0.5]
    sharp = replace(lens.problem, object_distances_mm=(1500.0,))
    bare = [_without_plate(sharp, scaled) for scaled in (lens.begin, plain)]
    assert bare[0] < 0.9 * bare[1]


def _without_plate(problem: Problem, scaled: torch.Tensor) -> float:
    at = scaled.clone()
    at[[0, -1]] = 0.0
    return merit(problem, at)


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
    found = best_starts(problem, Starts(count=8))[0]
    assert float(valid_share(problem, found[None])) == 1
    assert paraxial_data(problem.free.lens_at(found)).efl_mm == pytest.approx(50, abs=1e-6)
    assert merit(problem, found) < 0.6 * merit(problem, begin)


def test_more_starts_are_never_worse_than_the_given_one_alone(
    recipe: DesignRecipe, lens: Lens
) -> None:
    problem = far_off(recipe, lens, 4)
    alone = best_starts(problem, Starts(count=1, scout_steps=0, dls_steps=0))[0]
    torch.testing.assert_close(alone, problem.free.scaled(), rtol=0, atol=0)
    some = best_starts(problem, Starts(count=6, scout_steps=2, dls_steps=2))[0]
    assert merit(problem, some) <= merit(problem, alone)


def test_starts_from_anywhere_leave_the_neighbourhood_and_keep_their_order(
    recipe: DesignRecipe, lens: Lens
) -> None:
    problem = far_off(recipe, lens, 5)
    begin = problem.free.scaled()
    near = Starts(count=8, spread=0.02, scout_steps=0, dls_steps=0, judged=3)
    assert (best_starts(problem, near) - begin).abs().max() <= 0.02 + 1e-12
    found = best_starts(problem, replace(near, anywhere=0.9, scout_steps=4, judged=3))
    assert found.shape == (4, len(begin))
    torch.testing.assert_close(found[-1], begin, rtol=0, atol=0)
    marks = [merit(problem, scaled) for scaled in found[:-1]]
    assert marks == sorted(marks)
    assert (found[:-1] - begin).abs().max() > 0.1


def test_the_judge_decides_among_the_best_spots() -> None:
    lenses = list(torch.tensor([[0.1], [0.9], [0.4]]))
    assert best_judged(lenses, lambda scaled: -abs(float(scaled[0]) - 0.5)) == 0.4
    marks = {0.1: float("nan"), 0.9: 1.0, 0.4: 2.0}
    assert best_judged(lenses, lambda scaled: marks[round(float(scaled[0]), 1)]) == 0.4


def test_a_design_begins_at_the_start_that_is_recovered_best(table: dict[str, Any]) -> None:
    table["front"] = {"kind": "wiener"}
    table.pop("network", None)
    table["starts"] = {"count": 8, "spread": 0.3, "scout_steps": 2, "dls_steps": 2}
    by_spots = parts_of(to_design(table))
    table["starts"]["judged"] = 3
    judged = parts_of(to_design(table))
    plan = to_design(table).schedule

    def marked(parts: DesignParts) -> float:
        return DesignLoop(replace(parts, network=None), plan).judge().best_db

    assert marked(judged) >= marked(by_spots)
    among = best_starts(judged.lens.problem, to_design(table).starts)
    assert any(torch.equal(judged.lens.begin, one) for one in among)


def test_judged_starts_need_one_window_and_a_front_that_recovers(table: dict[str, Any]) -> None:
    table["starts"] = {"count": 8, "judged": 3}
    table["front"] = {"kind": "wiener"}
    table.pop("network", None)
    to_design(table)
    table["front"] = {"kind": "none"}
    with pytest.raises(ContractError, match="a front that recovers"):
        to_design(table)
    table["front"] = {"kind": "wiener"}
    table["pixels"]["kernel_px"] = 0
    with pytest.raises(ContractError, match="kernel_px"):
        to_design(table)


@pytest.mark.parametrize("kept", [{"lens_rate": 0.0}, {"search": False}])
def test_a_lens_that_is_to_stay_is_not_searched_for(
    table: dict[str, Any], kept: dict[str, Any]
) -> None:
    table["starts"] = {"count": 8, "spread": 0.3}
    lens = parts_of(with_choices(to_design(table), **kept)).lens
    assert torch.equal(lens.begin, lens.problem.free.scaled())


@pytest.mark.parametrize(
    ("entry", "word"),
    [
        ({"count": -1}, "count must be >= 0; got -1"),
        ({"spread": 1.5}, "spread must lie in 0..1; got 1.5"),
        ({"dls_steps": -1}, "dls_steps must be >= 0; got -1"),
        ({"anywhere": 1.1}, "anywhere must lie in 0..1"),
        ({"core_um": -1.0}, "core_um"),
        ({"merit": "area"}, "sum_abs"),
        ({"count": 8, "judged": 4}, "2 to 3 with a count of 8"),
        ({"count": 8, "judged": 1}, "2 to 3"),
        ({"judged": 2}, "count of 0"),
    ],
)
def test_wrong_starts_are_refused(table: dict[str, Any], entry: dict[str, Any], word: str) -> None:
    table["starts"] = entry
    with pytest.raises(ContractError, match=word):
        to_design(table)
