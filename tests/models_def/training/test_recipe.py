"""The common tables of a recipe; those of a kind are tested beside it."""

import math
import re

import pytest

from camkit.bundle.sensor import PlanesSensor
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.training.kind import read_recipe, to_recipe, training_kind
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
        ({"name": 3}, "name must be a text"),
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


SENSOR = TABLE["sensor"] | {
    "cfa": "RGGB",
    "width_px": 64,
    "height_px": 48,
    "pixel_pitch_um": 5.0,
}
SENSOR.pop("channels")


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        ({"width_px": "wide"}, "sensor.width_px must be a whole number; got 'wide'"),
        ({"width_px": 3.5}, "sensor.width_px must be a whole number; got 3.5"),
        ({"height_px": 0}, "sensor.height_px must be greater than 0; got 0"),
        ({"pixel_pitch_um": "x"}, "sensor.pixel_pitch_um must be a number; got 'x'"),
        ({"black_level": math.inf}, "sensor.black_level must be a finite number; got inf"),
        ({"noise": 3}, "sensor.noise must be a list; got 3"),
        ({"noise": [{"iso": 1.0, "gain_e_per_dn": "x"}]}, "sensor.noise[0].gain_e_per_dn must be"),
        ({"noise": [{"iso": 1.0}]}, "sensor.noise[0].gain_e_per_dn is missing"),
        ({"color_matrix": "x"}, "sensor.color_matrix must be a list; got 'x'"),
        ({"channel_response": 3}, "sensor.channel_response must be a table; got 3"),
        ({"colour": 3}, "sensor.colour is an unknown key"),
        ({"cfa": "RGBB"}, "sensor.cfa must "),
        ({"type": "film"}, "sensor.type must be one of 'bayer', 'planes', 'spad'; got 'film'"),
    ],
)
def test_faults_of_a_sensor_name_the_key_and_what_was_expected(sensor, message):
    with pytest.raises(ContractError) as refused:
        made(sensor=SENSOR | sensor)
    text = str(refused.value)
    assert message in text
    assert not re.search("Input|should|valid|validation|discriminator", text)


@pytest.mark.parametrize("kind", ["bayer", "nobody"])
def test_a_refused_recipe_is_named_by_its_file(kind, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(f'name = 3\nkind = "{kind}"\n', encoding="utf-8")
    with pytest.raises((ContractError, UnsupportedError)) as refused:
        read_recipe(path)
    assert str(refused.value).startswith(f"recipe {path}: ")
