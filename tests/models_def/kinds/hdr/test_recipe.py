"""Recipes of snapshot HDR: what is wrong is named, what decides samples is in their name."""

from collections.abc import Callable
from typing import Any

import pytest

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.recipe import (
    CAMERA_PARTS,
    ROLES,
    HdrRecipe,
    samples_digest,
    to_hdr_recipe,
)
from camkit.models_def.training.kind import read_recipe
from camkit.models_def.training.recipe import differing_part
from tests.models_def.kinds.hdr.conftest import SHIPPED


def test_the_shipped_recipe_is_a_camera_of_this_kind() -> None:
    recipe = read_recipe(SHIPPED)
    assert isinstance(recipe, HdrRecipe)
    assert recipe.kind == "hdr"
    assert recipe.plate.file == "streak-4"
    assert set(recipe.networks) == set(ROLES)
    assert set(recipe.networks["highlights"]) == {"S", "M"}
    levels = recipe.sensor.white_level - recipe.sensor.black_level
    full_well_e = recipe.sensor.noise[0].gain_e_per_dn * levels
    assert full_well_e == pytest.approx(recipe.sensor.full_well_e, rel=1e-3)


@pytest.mark.parametrize(
    ("change", "value", "named"),
    [
        ("colour", 1, "unknown key 'colour'"),
        ("plate__side", 401, "plate: unknown key 'side'"),
        ("plate__file", None, "plate"),
        ("plate__file", 3, "plate.file must be a text"),
        ("plate__side_px", 400, "plate.side_px must be odd, 65 or more; got 400"),
        ("plate__side_px", 63, "plate.side_px must be odd, 65 or more; got 63"),
        ("data__capture_px", 63, "data.capture_px must be even and hold a sample"),
        ("data__capture_px", 32, "data.capture_px must be even and hold a sample"),
        ("data__surround_px", -1, "surround_px be >= 0"),
        ("data__saturated_min", 0.0, "data.saturated_min must lie in"),
        ("data__saturated_min", 0.05, "data.saturated_min must lie in"),
        ("data__saturated_max", 1.0, "data.saturated_min must lie in"),
        ("data__as_it_is_share", 1.1, "data.as_it_is_share must lie in 0..1"),
        ("data__light_share", -0.1, "data.light_share must lie in 0..1"),
        ("data__iso_min", 0.0, "data.iso_min must be in"),
        ("data__iso_max", 50.0, "data.iso_min must be in"),
        ("object_distance_mm", None, "object_distance_mm"),
        ("object_distance_mm", "far", "object_distance_mm must be a number"),
        ("sensor__cfa", None, "this kind of camera has a Bayer mosaic; sensor.cfa is missing"),
        ("sensor__channel_response", None, "sensor needs .*channel_response"),
    ],
)
def test_what_is_wrong_in_a_recipe_is_named(
    changed: Callable[..., dict[str, Any]], change: str, value: Any, named: str
) -> None:
    with pytest.raises(ContractError, match=named):
        to_hdr_recipe(changed(**{change: value}))


@pytest.mark.parametrize(
    ("change", "value"),
    [
        ("data__sample_px", 96),
        ("data__saturated_max", 0.04),
        ("plate__file", "streak-3"),
        ("plate__side_px", 301),
        ("scale", 32.0),
        ("object_distance_mm", 4000.0),
        ("sensor__black_level", 250.0),
    ],
)
def test_samples_are_named_by_all_that_decides_them(
    changed: Callable[..., dict[str, Any]], tiny: HdrRecipe, change: str, value: Any
) -> None:
    other = to_hdr_recipe(changed(**{change: value}))
    assert samples_digest(other, 1) != samples_digest(tiny, 1)
    assert samples_digest(tiny, 2) != samples_digest(tiny, 1)


def test_how_a_network_is_trained_names_no_samples_and_no_camera(
    changed: Callable[..., dict[str, Any]], tiny: HdrRecipe
) -> None:
    other = to_hdr_recipe(changed(schedule__steps=9, networks__S__config={"bias": True}))
    assert samples_digest(other, 1) == samples_digest(tiny, 1)
    assert differing_part(tiny, other, CAMERA_PARTS) is None
    another = to_hdr_recipe(changed(plate__file="streak-3"))
    assert differing_part(tiny, another, CAMERA_PARTS) == "plate"
