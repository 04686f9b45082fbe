"""The common tables of a recipe; those of a kind are tested beside it."""

import pytest

from camkit.bundle.sensor import PlanesSensor
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.training.kind import to_recipe, training_kind
from camkit.models_def.training.recipe import (
    AHEAD,
    DataRecipe,
    Recipe,
    common_tables,
    differing_part,
    with_new_names,
)
from camkit.models_def.training.refinement import refining_kind

TABLE = {
    "name": "grey",
    "kind": "toy",
    "sensor": {
        "channels": ["Y"],
        "black_level": 0.0,
        "white_level": 255.0,
        "full_well_e": 1000.0,
        "noise": [{"iso": 100.0, "gain_e_per_dn": 4.0, "read_noise_e": 1.0}],
    },
    "schedule": {"steps": 9},
    "networks": {"first": {"S": {"network": "a"}}, "second": {"S": {"network": "b"}}},
}
ROLES = ("first", "second")


def made(roles=ROLES, **changes):
    common = common_tables(TABLE | changes, kind_keys=(), roles=roles)
    return Recipe(
        name=common.name,
        kind=common.kind,
        sensor=common.sensor,
        data=DataRecipe(),
        networks=common.networks,
    )


def test_networks_are_found_by_role_and_size():
    recipe = made()
    assert isinstance(recipe.sensor, PlanesSensor)
    assert recipe.network("S", "second").network == "b"
    assert recipe.network("S", "first").schedule.steps == 9
    with pytest.raises(ContractError, match="roles first, second; choose one"):
        recipe.network("S")
    with pytest.raises(ContractError, match="of the role first, second; not 'third'"):
        recipe.network("S", "third")
    with pytest.raises(ContractError, match="sizes S; got 'M'"):
        recipe.network("M", "first")


def test_a_kind_of_one_role_needs_not_name_it():
    sizes = {"S": {"network": "a"}, "M": {"network": "b", "schedule": {"steps": 3}}}
    for networks in (sizes, {"first": sizes}):
        recipe = made(roles=("first",), networks=networks)
        assert recipe.network("M").schedule.steps == 3
        assert recipe.role(None) == "first"


@pytest.mark.parametrize(
    ("networks", "message"),
    [
        ({"S": {"network": "a"}}, r"networks\.S is of no role; write \[networks\.ROLE\.S\]"),
        ({"third": {"S": {"network": "a"}}}, r"networks\.third is of no role"),
        ({"first": {"S": 3}}, r"networks\.first\.S must be a table"),
        ({"first": {"S": {}}}, r"networks\.first\.S\.network is missing"),
        ({"first": {"S": {"network": "a", "schedule": 3}}}, r"schedule must be a table"),
        ({"first": 3}, r"networks\.first must be a table"),
        ([], "at least one table"),
    ],
)
def test_networks_of_no_role_are_refused(networks, message):
    with pytest.raises(ContractError, match=message):
        made(networks=networks)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lens": {}}, "unknown key 'lens'"),
        ({"sensor": {**TABLE["sensor"], "black_level": 300.0}}, "sensor: .*must lie above"),
        ({"sensor": {**TABLE["sensor"], "width_px": 0}}, r"sensor\.width_px"),
        ({"name": 3}, "name must be of type str"),
    ],
)
def test_wrong_common_tables_are_refused_by_naming_the_key(change, message):
    with pytest.raises(ContractError, match=message):
        made(**change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"first_samples": 9, "pool_samples": 9}, "between 0 and pool_samples"),
        ({"first_samples": 9, "pool_samples": AHEAD}, "must exceed the 32 samples .* got 32$"),
        ({"picture_share": -0.1}, r"picture_share must lie in 0\.\.1"),
        ({"scene_px": 0}, "must be positive"),
    ],
)
def test_data_that_cannot_be_is_refused(change, message):
    with pytest.raises(ContractError, match=message):
        DataRecipe(**change)


def test_older_names_are_taken_and_both_at_once_are_not():
    assert with_new_names({"camera": 1, "name": 2}, {"camera": "sensor"}) == {
        "sensor": 1,
        "name": 2,
    }
    with pytest.raises(ContractError, match="camera is the older name of sensor"):
        with_new_names({"camera": 1, "sensor": 2}, {"camera": "sensor"})


def test_the_first_part_that_differs_is_named():
    one, other = made(), made(name="other")
    assert differing_part(one, one, ("kind", "name")) is None
    assert differing_part(one, other, ("kind", "name")) == "name"


def test_a_recipe_of_an_unknown_kind_is_refused():
    with pytest.raises(UnsupportedError, match="no kind of camera 'nobody'"):
        to_recipe(TABLE | {"kind": "nobody"})


def test_what_a_kind_does_not_bring_is_said(monkeypatch):
    from camkit.models_def.kinds import bayer

    monkeypatch.delattr(bayer, "PART")
    monkeypatch.delattr(bayer, "REFINING")
    with pytest.raises(ContractError, match="must define PART"):
        training_kind("bayer")
    with pytest.raises(UnsupportedError, match="not fine-tuned"):
        refining_kind("bayer")
