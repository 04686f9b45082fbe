import pytest
import torch

from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.optics import LensModule
from camkit.models_def.design.recipe import DesignRecipe, to_design
from tests.small_design import small_design
from tools.design.score import at_lens, score_design


@pytest.fixture
def recipe() -> DesignRecipe:
    return to_design(small_design())


def test_a_score_is_the_same_every_time_and_falls_with_defocus(recipe: DesignRecipe) -> None:
    parts = parts_of(recipe)
    sharp = parts.lens.begin.clone()
    soft = sharp.clone()
    soft[-1] = (soft[-1] + 0.4).clamp(0, 1)
    one, again, away = (
        score_design(parts, recipe.schedule, s, source=parts.source, patches_per_field=2)
        for s in (sharp, sharp, soft)
    )
    assert one == again
    assert len(one.by_field_db) == 3
    assert away.psnr_db < one.psnr_db - 0.3


def test_parts_at_a_lens_have_that_lens(recipe: DesignRecipe) -> None:
    parts = parts_of(recipe)
    scaled = torch.tensor([0.4, 0.6, 0.5], dtype=torch.float64)
    lens = at_lens(parts, scaled, rays=64).lens
    assert isinstance(lens, LensModule)
    torch.testing.assert_close(lens.scaled().detach(), scaled)
    assert len(lens.problem.samples.x) == 64
