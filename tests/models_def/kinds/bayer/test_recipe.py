import tomllib
from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.recipe import CAMERA_PARTS, samples_digest
from camkit.models_def.training.kind import read_recipe, to_recipe, training_kind
from camkit.models_def.training.recipe import differing_part
from tests.bayer_recipe import planes_text
from tests.changed_table import changed_table
from tests.together_factory import TOGETHER

RECIPES = Path(__file__).resolve().parents[4] / "models_def" / "recipes"
SHIPPED = RECIPES / "duet.toml"


def differing_camera(one, other):
    return differing_part(one, other, CAMERA_PARTS)


def table(recipe_path, **changes):
    return changed_table(recipe_path.read_text(encoding="utf-8"), **changes)


def test_shipped_recipe_has_its_networks_and_the_stated_sensor():
    recipe = read_recipe(SHIPPED)
    assert set(recipe.networks["restore"]) == {"S", "M", "trimmed"}
    sensor = recipe.sensor
    assert (sensor.width_px, sensor.height_px, sensor.pixel_pitch_um) == (6000, 4000, 5.96)
    levels = sensor.white_level - sensor.black_level
    full_well_e = sensor.noise[0].gain_e_per_dn * levels
    assert full_well_e == pytest.approx(sensor.full_well_e, rel=1e-3)


def test_network_schedule_overrides_the_common_one(recipe):
    assert recipe.network("S").schedule.steps == 12
    assert recipe.network("M").schedule.steps == 60
    assert recipe.network("M").schedule.batch == 2


@pytest.mark.parametrize(
    ("change", "value", "named"),
    [
        ("colour", 1, "recipe: unknown key 'colour'"),
        ("data__sampel_px", 64, "data: unknown key 'sampel_px'"),
        ("data__sample_px", 64.5, "data.sample_px must be a whole number"),
        ("data__picture_share", 1.5, "data.picture_share must lie in 0..1"),
        ("data__drift_share", -0.1, "data.drift_share must lie in 0..1"),
        ("data__drift_scale", 0.5, "data.drift_scale must be in"),
        ("data__edge_share", 1.2, "data.edge_share must lie in 0..1"),
        ("data__night_share", -0.1, "data.night_share must lie in 0..1"),
        ("data__lamp_share", 1.1, "data.lamp_share must lie in 0..1"),
        ("schedule__overshoot", -1.0, "schedule.overshoot must be >= 0"),
        ("schedule__loss", "l3", "schedule.loss must be one of"),
        ("schedule__precision", "float8", "schedule.precision must be one of"),
        ("schedule__steps", True, "schedule.steps must be a whole number"),
        ("lens__prescription", None, "lens needs prescription"),
        ("lens__copies", 0, "lens.copies and lens.validation_copies must be >= 1; got 0, 1"),
        ("lens__validation_copies", 0, "lens.validation_copies must be >= 1"),
        ("sensor__width_px", -1, "sensor.width_px"),
        ("sensor__shape", 3, "sensor.shape"),
        ("wiener__prior_scale", None, "wiener.prior_scale"),
        ("networks__S__netwrok", "x", "networks.S: unknown key"),
        ("networks__S__network", None, "networks.S.network is missing"),
        ("networks__S", 3, "networks.S must be a table"),
        ("schedule", 3, "schedule must be a table"),
        ("sensor", 3, "sensor must be a table"),
        ("sensor__cfa", None, "sensor.cfa is missing"),
        ("sensor__type", "spad", "sensor"),
        ("sensor__channel_response", None, "channel_response"),
        ("fine_tuning", 3, "fine_tuning must be a table"),
        ("frames", {"count": 2}, "there is no table .haze."),
        ("kind", 3, "kind must be a text"),
        ("networks", {}, "at least one table"),
        ("name", None, "name is missing"),
    ],
)
def test_wrong_recipes_are_refused_by_naming_the_key(recipe_path, change, value, named):
    with pytest.raises(ContractError, match=named):
        to_recipe(table(recipe_path, **{change: value}))


def test_recipes_of_old_checkpoints_have_fine_tuning_under_its_older_name(recipe_path):
    text = recipe_path.read_text(encoding="utf-8")
    settings = "\npixel_weight = 0.006\nschedule = { steps = 7 }\n"
    older = to_recipe(tomllib.loads(text + "[final]" + settings))
    today = to_recipe(tomllib.loads(text + "[fine_tuning]" + settings))
    assert older == today
    assert (older.fine_tuning.pixel_weight, older.fine_tuning.schedule.steps) == (0.006, 7)


def test_recipes_of_old_checkpoints_have_the_sensor_under_its_older_name(recipe_path):
    text = recipe_path.read_text(encoding="utf-8")
    older = to_recipe(tomllib.loads(text.replace("[sensor", "[camera")))
    assert older == read_recipe(recipe_path)
    with pytest.raises(ContractError, match="camera is the older name of sensor"):
        to_recipe(tomllib.loads(text) | {"camera": {}})


def test_fine_tuning_under_both_names_is_refused(recipe_path):
    with pytest.raises(ContractError, match="final is the older name of fine_tuning"):
        to_recipe(table(recipe_path, final={}, fine_tuning={}))


def test_unknown_size_is_refused_with_those_there_are(recipe):
    with pytest.raises(ContractError, match="S, M; got 'XL'"):
        recipe.network("XL")


def test_missing_and_broken_files_are_refused(tmp_path):
    with pytest.raises(ContractError, match="cannot read recipe"):
        read_recipe(tmp_path / "none.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("name = ", encoding="utf-8")
    with pytest.raises(ContractError, match="not valid TOML"):
        read_recipe(broken)


def test_digest_follows_what_decides_the_samples_only(recipe_path, recipe):
    same = to_recipe(table(recipe_path, schedule__steps=99))
    other = to_recipe(table(recipe_path, wiener__prior_scale=1e-4))
    assert samples_digest(same, 1) == samples_digest(recipe, 1)
    assert samples_digest(other, 1) != samples_digest(recipe, 1)
    assert samples_digest(recipe, 2) != samples_digest(recipe, 1)


def test_training_may_differ_within_a_camera_but_nothing_else(recipe_path):
    one = to_recipe(table(recipe_path))
    longer = to_recipe(table(recipe_path, schedule__steps=99, data__iso_max=900.0))
    assert differing_camera(one, longer) is None
    assert differing_camera(one, to_recipe(table(recipe_path, scale=32.0))) == "scale"
    assert differing_camera(one, to_recipe(table(recipe_path, wiener__overlap_px=16))) == "wiener"


def test_depths_decide_the_samples_where_there_are_any(recipe_path):
    deep = to_recipe(table(recipe_path, lens__depths_mm=[500, 1000.0]))
    plain = to_recipe(table(recipe_path))
    assert deep.lens.depths_mm == (500.0, 1000.0)
    assert samples_digest(deep, 1) != samples_digest(plain, 1)
    assert "depths_mm" not in plain.lens.to_json()
    assert differing_camera(deep, plain) == "lens"


@pytest.mark.parametrize("depths_mm", [[1000.0, 500.0], [0.0, 1.0], [700.0, 700.0]])
def test_depths_that_do_not_increase_are_refused(recipe_path, depths_mm):
    with pytest.raises(ContractError, match=r"lens\.depths_mm"):
        to_recipe(table(recipe_path, lens__depths_mm=depths_mm))


def test_only_several_depths_can_be_known(recipe_path):
    with pytest.raises(ContractError, match="need two or more"):
        to_recipe(table(recipe_path, data__known_depth_share=0.5))
    with pytest.raises(ContractError, match=r"must lie in 0\.\.1"):
        to_recipe(table(recipe_path, data__known_depth_share=1.5))
    with pytest.raises(ContractError, match="need two or more"):
        to_recipe(table(recipe_path, wiener__depth="estimated"))
    several = {"lens__depths_mm": [500.0, 900.0]}
    with pytest.raises(ContractError, match="for filters that are told a depth"):
        to_recipe(table(recipe_path, **several, data__depth_error=0.1))
    with pytest.raises(ContractError, match=r"leave data\.known_depth_share out"):
        to_recipe(
            table(recipe_path, **several, wiener__depth="estimated", data__known_depth_share=0.5)
        )
    found = to_recipe(table(recipe_path, **several, wiener__depth="estimated"))
    assert found.estimates_depth
    assert found.tells_depth


@pytest.mark.parametrize(
    ("shares", "message"),
    [([1.0], "1 entries"), ([1.0, 0.0], "positive"), ([1.0, float("inf")], "finite")],
)
def test_shares_of_depths_must_fit_the_depths(recipe_path, shares, message):
    with pytest.raises(ContractError, match=message):
        to_recipe(table(recipe_path, lens__depths_mm=[500.0, 900.0], data__depth_shares=shares))


def test_all_faults_are_named_at_once() -> None:
    table = {
        "called": "x",
        "sensor": {"cfa": "RGGB", "width_px": -1},
        "wiener": {"block": 3},
        "lens": {"copies": "many"},
        "data": {"foo": 1, "iso_max": "x"},
    }
    with pytest.raises(ContractError) as refusal:
        to_recipe(table)
    for fault in (
        "unknown key 'called'",
        "name is missing",
        "sensor.width_px must be greater than 0; got -1",
        "sensor.noise is missing",
        "at least one table [networks.SIZE]",
        "object_distance_mm is missing",
        "wiener.prior_scale is missing",
        "wiener.block is an unknown key",
        "lens.copies must be a whole number; got 'many'",
        "data: unknown key 'foo'; known are ",
        "data.iso_max must be a number; got 'x'",
    ):
        assert fault in str(refusal.value)


@pytest.mark.parametrize(
    ("channels", "absent"),
    [("RGB", {"demosaic"}), ("Y", {"demosaic", "white_balance", "raise_clipped"})],
)
def test_a_sensor_of_planes_has_no_stage_of_a_mosaic(channels, absent):
    recipe = to_recipe(tomllib.loads(planes_text(channels)))
    types = [stage.type for stage in training_kind("bayer").design(recipe).stages]
    usual = [*(s.type for s in training_kind("bayer").design(read_recipe(SHIPPED)).stages)]
    assert types == [name for name in usual if name not in absent]


@pytest.mark.parametrize(
    ("change", "value", "named"),
    [
        ("sensor__channels", ["R", "G"], "channels R, G, B or Y alone"),
        ("sensor__channel_response", None, "sensor needs width_px.*channel_response"),
        ("sensor__width_px", None, "width_px"),
        ("wiener__mosaic", {"within_mm": 1.0}, "a sensor of planes has no mosaic, which"),
    ],
)
def test_a_wrong_sensor_of_planes_is_refused(change, value, named):
    table = changed_table(planes_text(), **{change: value})
    if change == "sensor__channels":
        table["sensor"]["channel_response"]["response"].pop()
    if change == "wiener__mosaic":
        table["wiener"]["together"] = TOGETHER.model_dump(mode="json")
    with pytest.raises(ContractError, match=named):
        to_recipe(table)


def test_a_grey_camera_is_not_trained_and_the_reason_is_said(tmp_path):
    recipe = to_recipe(tomllib.loads(planes_text("Y")))
    with pytest.raises(ContractError, match="trained on three colours, and the camera tiny is"):
        training_kind("bayer").prepare(recipe, tmp_path, tmp_path)
