"""Lens files in the place of a free lens."""

import math
from dataclasses import replace

import pytest
import torch

from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.design_recipe import DesignRecipe, to_design
from camkit.models_def.design.lens_module import LensModule
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.paraxial import paraxial_data, paraxial_image
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.splat import Pixels
from camkit.models_def.optics.search.variables import FreeLens
from tests.small_design import small_design
from tools.tables.lenses.lens_at_rest import at_rest, at_work, window_of
from tools.tables.lenses.lens_table import scores


@pytest.fixture
def recipe() -> DesignRecipe:
    return to_design(small_design())


def _problem(lens: Lens, *slopes: float) -> Problem:
    return Problem(
        free=FreeLens(lens=lens, variables=(), rides=False),
        slopes=torch.tensor(slopes, dtype=torch.float64),
        wavelengths_um=torch.tensor([0.46, 0.54, 0.61], dtype=torch.float64),
        object_distances_mm=(lens.object_distance_mm,),
    )


def _pixels(kernel_px: int) -> Pixels:
    return Pixels(
        pitch_um=6.0, kernel_px=kernel_px, color_weights=torch.eye(3, dtype=torch.float64)
    )


def test_a_lens_at_work_has_its_f_number_and_focus() -> None:
    lens = at_work(find_lens("double-gauss-f2"), f_number=4.0, object_distance_mm=1000.0)
    assert paraxial_data(lens).f_number == pytest.approx(4.0, rel=1e-12)
    assert lens.surfaces[-1].thickness_mm == pytest.approx(paraxial_image(lens).distance_mm)


def test_a_lens_made_for_the_distance_keeps_its_sensor_unless_told() -> None:
    lens = replace(find_lens("duet"), object_distance_mm=1000.0)
    kept, moved = (
        at_work(lens, f_number=4.0, object_distance_mm=1000.0, focus=focus)
        for focus in (None, "paraxial")
    )
    assert kept.surfaces[-1].thickness_mm == lens.surfaces[-1].thickness_mm
    assert moved.surfaces[-1].thickness_mm != lens.surfaces[-1].thickness_mm


def test_kernels_at_rest_are_those_of_the_free_lens_where_both_see_one_pupil(
    recipe: DesignRecipe,
) -> None:
    """On the axis of a lens whose stop is in front the paraxial pupil is the real one."""
    lens = parts_of(recipe).lens
    problem = replace(lens.problem, samples=half_disc(4000))
    free = LensModule(problem, lens.pixels, lens.begin, whiten=False)
    expected, _ = free()
    rest, _ = at_rest(free.lens(), free.problem, free.pixels, 4000)
    found, penalty = rest()
    assert float(penalty) == 0
    assert torch.allclose(found[0, 0].double(), expected[0, 0].detach(), atol=2e-5)


def test_light_outside_the_window_is_spread_evenly_and_told() -> None:
    lens = at_work(find_lens("al2550-a"), f_number=4.0, object_distance_mm=1000.0)
    problem = _problem(lens, 0.0, math.tan(math.radians(20)))
    rest, seen = at_rest(lens, problem, _pixels(65), 2000)
    kernels = rest()[0]
    assert torch.allclose(kernels.sum((-2, -1)), torch.ones(1, 2, 3), atol=1e-5)
    assert float(seen.share_inside[0, 0]) > 0.5
    assert float(seen.share_inside[0, 1]) < 0.2
    floor = float((1 - seen.share_inside[0, 1]) / 65**2)
    assert float(kernels[0, 1].min()) >= 0.5 * floor
    assert seen.rms_mm[0, 1] > 0.5


def test_the_window_holds_the_light_or_ends_at_the_cap() -> None:
    lens = at_work(find_lens("duet"), f_number=4.0, object_distance_mm=1000.0)
    problem = _problem(lens, 0.0, 0.3)
    side = window_of(problem, _pixels(65), 1001)
    assert side % 2 == 1
    assert float(at_rest(lens, problem, _pixels(side), 2000)[1].share_inside.min()) > 0.99
    assert window_of(problem, _pixels(65), 35) == 35


def test_a_field_beyond_the_lens_has_an_even_kernel_and_no_light() -> None:
    lens = at_work(find_lens("cooke-triplet"), f_number=4.0, object_distance_mm=1000.0)
    rest, seen = at_rest(lens, _problem(lens, 0.0, 30.0), _pixels(33), 500)
    assert seen.arriving[0].tolist() == [1.0, 0.0]
    assert math.isnan(seen.rms_mm[0, 1])
    even = torch.full((3, 33, 33), 1 / 33**2)
    assert torch.allclose(rest()[0][0, 1], even)


def test_scores_of_a_lens_at_rest_fall_off_the_axis(
    recipe: DesignRecipe,
) -> None:
    """The front alone: captures of a doublet, at a field that it cannot image."""
    lens = at_work(find_lens("aca254-050-a"), f_number=4.0, object_distance_mm=1000.0)
    rest, _ = at_rest(lens, _problem(lens, 0.0, 0.35), _pixels(65), 2000)
    parts = replace(parts_of(recipe), lens=rest, network=None)
    found = scores(parts, recipe.schedule, 2)
    assert found["db"][0][0] > found["db"][0][1] + 2
    assert found["ssim"][0][0] > found["ssim"][0][1]
