"""Sensors by few words: what is stated is kept, what is not is a default that says so."""

import tomllib

import numpy as np
import pytest

from camkit.cfa import CFA_PATTERNS
from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.recipe_draft import RecipeDraft, recipe_text
from camkit.models_def.sensors.sensor_choice import (
    choose_sensor,
    isos_of,
    named_sensors,
    sensor_of,
)
from camkit.models_def.training.kind import to_recipe
from camkit.noise import NoiseModel
from camkit.runtime.capture import Capture


def recipe_of(text: str) -> BayerRecipe:
    draft = RecipeDraft(name="any", sensor=choose_sensor(text), optics="duet", focus_mm=np.inf)
    recipe = to_recipe(tomllib.loads(recipe_text(draft)))
    assert isinstance(recipe, BayerRecipe)
    return recipe


def test_a_size_and_a_pitch_make_a_sensor_whose_defaults_are_marked() -> None:
    choice = choose_sensor("6000x4000@3.9um")
    assert (choice.table["width_px"], choice.table["height_px"]) == (6000, 4000)
    assert choice.table["pixel_pitch_um"] == 3.9
    assert choice.sources["width_px"] == "stated"
    marked = {key for key, source in choice.sources.items() if source.startswith("default")}
    assert marked == {"cfa", "black_level", "white_level", "full_well_e", "color_matrix"}
    sensor = recipe_of("6000x4000@3.9um").sensor
    # half the gain at twice the ISO; a full pixel at the lowest is white
    first, second = sensor.noise[:2]
    assert first.gain_e_per_dn == pytest.approx(2 * second.gain_e_per_dn, rel=1e-6)
    full_e = first.gain_e_per_dn * (sensor.white_level - sensor.black_level)
    assert full_e == pytest.approx(sensor.full_well_e, rel=1e-5)


def test_a_pattern_may_be_stated() -> None:
    assert choose_sensor("640x480@5um:bggr").table["cfa"] == "BGGR"
    assert choose_sensor("imx264:GRBG").table["cfa"] == "GRBG"
    assert choose_sensor("IMX477").table["cfa"] == "BGGR"


@pytest.mark.parametrize(
    ("kind", "channels"), [("planes", ("R", "G", "B")), ("grey", ("Y",)), ("Grey", ("Y",))]
)
def test_a_sensor_may_have_no_mosaic(kind: str, channels: tuple[str, ...]) -> None:
    choice = choose_sensor(f"768x512@46.875um:{kind}")
    assert choice.sources["channels"] == "stated"
    marked = {key for key, source in choice.sources.items() if source.startswith("default")}
    assert marked == {"black_level", "white_level", "full_well_e"}
    recipe = recipe_of(f"768x512@46.875um:{kind}")
    sensor = recipe.sensor
    assert (sensor.cfa, sensor.channels, sensor.color_matrix) == (None, channels, None)
    assert sensor.channel_response is not None
    assert len(sensor.channel_response.response) == len(channels)
    assert recipe.data.light_share == 0, "developed pictures are white-balanced"


def test_noise_of_a_developed_picture_is_at_least_that_of_rounding_to_8_bits() -> None:
    levels = decode_srgb(np.arange(256, dtype=np.float32) / 255).astype(np.float64)
    rounding = np.diff(levels) ** 2 / 12
    shot, _ = recipe_of("768x512@46.875um:planes").sensor.one_noise_at(100)
    ratios = shot * (levels[1:] + levels[:-1])[40:] / 2 / rounding[40:]
    assert 0.7 < ratios.min() < ratios.max() < 1.5
    # small pixels hold fewer electrons, whose noise is what counts
    assert recipe_of("6000x4000@3.9um:planes").sensor.full_well_e == pytest.approx(2000 * 3.9**2)


def test_a_named_sensor_comes_in_grey() -> None:
    named, grey = choose_sensor("IMX264"), choose_sensor("IMX264:grey")
    assert grey.table["channels"] == ("Y",)
    assert grey.table["full_well_e"] == named.table["full_well_e"]
    assert "cfa" not in grey.table


def test_a_developed_picture_states_its_size_alone() -> None:
    planes = photo(
        samples=np.zeros((3, 48, 64), np.uint16),
        cfa=None,
        black_level=np.zeros(3, np.float32),
        noise=None,
    )
    table = sensor_of(planes).table
    assert (table["type"], table["channels"]) == ("planes", ("R", "G", "B"))
    assert (table["width_px"], table["height_px"], table["white_level"]) == (64, 48, 65535.0)


@pytest.mark.parametrize("name", sorted(named_sensors()))
def test_named_sensors_make_recipes_and_state_their_source(name: str) -> None:
    entry, recipe = named_sensors()[name], recipe_of(name)
    assert recipe.sensor.cfa in CFA_PATTERNS
    assert recipe.sensor.full_well_e == pytest.approx(entry["full_well_e"])
    assert recipe.sensor.noise[0].read_noise_e == pytest.approx(entry["read_noise_e"])
    assert len(entry["source"]) > 10


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("6000x4000", "takes WIDTHxHEIGHT@PITCHum.* one of IMX174.*got '6000x4000'"),
        ("6000x4000@3.9um:RGBW", "one of RGGB, BGGR, GRBG, GBRG, PLANES, GREY; got 'RGBW'"),
        ("IMX9", "got 'IMX9'"),
    ],
)
def test_what_is_no_sensor_is_refused(text: str, message: str) -> None:
    with pytest.raises(ContractError, match=message):
        choose_sensor(text)


def photo(**changes: object) -> Capture:
    facts: dict[str, object] = {
        "samples": np.zeros((48, 64), np.uint16),
        "cfa": "RGGB",
        "black_level": np.full((2, 2), 64, np.float32),
        "white_level": 1023.0,
        "iso": 400.0,
        "noise": NoiseModel(shot=(4e-4,) * 3, read_variance=(1e-6,) * 3),
        "camera": "Maker Model",
        "pixel_pitch_um": 2.4,
    }
    return Capture(**{**facts, **changes})  # type: ignore[arg-type]


def test_a_photograph_states_its_sensor() -> None:
    choice = sensor_of(photo(origin_px=(1, 0), sensor_size_px=(100, 80)))
    table = choice.table
    assert (table["width_px"], table["height_px"], table["cfa"]) == (100, 80, "GRBG")
    assert (table["black_level"], table["white_level"]) == (64.0, 1023.0)
    # 1 / shot electrons at white of ISO 400, four times as many at 100; sqrt(1e-6) / 4e-4 read
    assert table["full_well_e"] == pytest.approx(10_000)
    at_400 = next(entry for entry in table["noise"] if entry["iso"] == 400)
    assert at_400["gain_e_per_dn"] * 959 == pytest.approx(2500, rel=1e-5)
    assert at_400["read_noise_e"] == pytest.approx(2.5)
    assert choice.sources["cfa"] == "Maker Model"


def test_a_photograph_without_pitch_is_refused() -> None:
    with pytest.raises(ContractError, match="states no pixel pitch; state it by pitch_um"):
        sensor_of(photo(pixel_pitch_um=None))
    assert sensor_of(photo(pixel_pitch_um=None), 3.0).table["pixel_pitch_um"] == 3.0


def test_a_small_pixel_has_no_high_iso() -> None:
    assert isos_of(72_000.0)[-1] == 6400
    assert isos_of(8000.0)[-1] == 3200
    assert isos_of(3920.0)[-1] == 800
    assert isos_of(20.0) == (100,)
    (last,) = choose_sensor("1600x1200@1.4um").table["noise"][-1:]
    assert last["iso"] == 800.0
