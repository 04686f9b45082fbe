"""The tables [thesis] and [glare]: their defaults are the thesis's, wrong values are named."""

import tomllib
from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.recipe import reference_digest, samples_digest
from camkit.models_def.kinds.hdr.thesis_recipe import GlareRecipe, ThesisRecipe
from camkit.models_def.training.kind import read_recipe, to_recipe

RECIPES = Path(__file__).resolve().parents[4] / "models_def" / "recipes"


@pytest.mark.parametrize(
    ("name", "roles", "optics"),
    [
        ("streak_thesis", ["split", "highlight", "fusion", "whole"], "plate"),
        ("bare_lens", ["whole"], "bare"),
        ("glare_thesis", ["split"], "glare"),
        ("streak_hdr", ["highlights"], "plate"),
    ],
)
def test_shipped_recipes_have_their_roles(name, roles, optics):
    recipe = read_recipe(RECIPES / f"{name}.toml")
    assert (list(recipe.networks), recipe.thesis.optics) == (roles, optics)


def test_glare_is_that_of_the_thesis_and_its_loss_eq_5_9_alone():
    recipe = read_recipe(RECIPES / "glare_thesis.toml")
    glare = recipe.glare
    assert (glare.alpha, glare.beta, glare.m) == (1.0, 0.00025, 0.014)
    assert (glare.angle_min_deg, glare.angle_max_deg) == (2.5, 8.0)
    assert recipe.thesis.streak_weight == 0
    assert recipe.thesis.perceptual_weight > 0 < recipe.thesis.exclusion_weight


def test_one_to_three_percent_of_every_scene_saturate():
    data = read_recipe(RECIPES / "streak_thesis.toml").data
    assert (data.saturated_min, data.saturated_max, data.as_it_is_share) == (0.01, 0.03, 0.0)


def test_samples_of_the_shipped_network_do_not_depend_on_the_new_tables():
    table = tomllib.loads((RECIPES / "streak_hdr.toml").read_text(encoding="utf-8"))
    one = to_recipe(table)
    other = to_recipe(table | {"thesis": {"optics": "bare"}, "glare": {"m": 0.02}})
    assert samples_digest(one, 1) == samples_digest(other, 1)


def test_samples_of_a_reference_are_told_apart_by_role_optics_and_glare():
    table = tomllib.loads((RECIPES / "glare_thesis.toml").read_text(encoding="utf-8"))
    changed = [
        table,
        table | {"glare": {"m": 0.02}},
        table | {"thesis": {"optics": "plate"}},
    ]
    digests = {reference_digest(to_recipe(one), "split", 1) for one in changed}
    digests |= {reference_digest(to_recipe(table), "whole", 1)}
    digests |= {reference_digest(to_recipe(table), "split", 2)}
    assert len(digests) == 5
    # of a plate, glare changes nothing
    plate = table | {"thesis": {"optics": "plate"}}
    other = plate | {"glare": {"m": 0.02}}
    assert reference_digest(to_recipe(plate), "split", 1) == reference_digest(
        to_recipe(other), "split", 1
    )


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"exclusion_from": 1.5}, "thesis.exclusion_from"),
        ({"highlight_weight": -1.0}, "weights of thesis must be >= 0"),
        ({"vgg_widths": (1, 2)}, "thesis.vgg_widths must be 5"),
    ],
)
def test_wrong_settings_are_named(changes, named):
    with pytest.raises(ContractError, match=named):
        ThesisRecipe(**changes)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"m": 0.0}, "alpha, beta, m > 0"),
        ({"reach_px": 0}, "reach_px >= 1"),
        ({"angle_max_deg": 50.0}, r"must lie in 0\.\.45; got 2.5, 50"),
        ({"angle_min_deg": 9.0}, "angle_min_deg <= angle_max_deg"),
    ],
)
def test_wrong_glare_is_named(changes, named):
    with pytest.raises(ContractError, match=named):
        GlareRecipe(**changes)


def test_an_unknown_optics_is_refused():
    table = tomllib.loads((RECIPES / "streak_thesis.toml").read_text(encoding="utf-8"))
    with pytest.raises(ContractError, match=r"thesis\.optics must be one of plate, bare, glare"):
        to_recipe(table | {"thesis": {"optics": "fog"}})
