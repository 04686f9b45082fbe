"""Displays and daylight in closed form; recipes that say nothing of them keep their samples."""

import dataclasses
import json

import numpy as np
import pytest

from camkit.colorimetry import D65, REC709_PRIMARIES, decode_srgb, encode_srgb, rgb_to_xyz
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.recipe import to_bayer_recipe
from camkit.models_def.kinds.bayer.scene_light import (
    LUMINANCE,
    DisplayRecipe,
    WildRecipe,
    daylight,
    with_range,
)
from camkit.models_def.kinds.bayer.training import BayerMaker
from camkit.side_file import parse_toml
from tests.bayer_recipe import RECIPE, bank, recipe, recipe_path  # noqa: F401

WIDE = ((0.68, 0.32), (0.265, 0.69), (0.15, 0.06))


def grey(*values):
    return np.broadcast_to(np.array(values, np.float32), (3, 1, len(values)))


def read(tables):
    return to_bayer_recipe(parse_toml((RECIPE + tables).encode(), "recipe"))


def test_light_of_a_display_has_steps_of_its_codes():
    ramp = grey(*np.linspace(0, 1, 5001))
    for bits in (4, 8):
        light, _ = DisplayRecipe(bits=bits, contrast=1e9).shown_light(ramp)
        levels = np.unique(light[1].round(7))
        assert len(levels) == 2**bits
        # each is the light of a code, and the nearest code in the tone of sRGB
        codes = encode_srgb(levels.astype(np.float32)) * (2**bits - 1)
        np.testing.assert_allclose(codes, np.rint(codes), atol=2e-2)
        gap = np.abs(encode_srgb(light[1]) - encode_srgb(ramp[1]))
        assert gap.max() < 0.5 / (2**bits - 1) + 1e-4


def test_black_is_white_over_contrast_and_white_stays():
    light, _ = DisplayRecipe(contrast=200.0).shown_light(grey(0.0, 1.0, 7.0, -1.0))
    np.testing.assert_allclose(light[:, 0], grey(1 / 200, 1, 1, 1 / 200)[:, 0], rtol=1e-5)


def test_a_display_of_rec709_shows_what_it_is_told():
    np.testing.assert_allclose(DisplayRecipe().to_rec709, np.eye(3), atol=1e-12)
    codes = np.random.default_rng(0).integers(0, 256, (3, 5, 7)) / 255
    picture = decode_srgb(codes.astype(np.float32))
    light, truth = DisplayRecipe(contrast=1e9).shown_light(picture)
    np.testing.assert_allclose(light, picture, atol=1e-6)
    assert truth is light


def test_primaries_are_where_the_recipe_has_them():
    display = DisplayRecipe(primaries=WIDE, contrast=1e9)
    to_xyz = rgb_to_xyz(REC709_PRIMARIES, D65)
    for channel, (x, y) in enumerate(WIDE):
        told = np.zeros((3, 1, 1), np.float32)
        told[channel] = 1
        xyz = to_xyz @ display.shown_light(told)[0][:, 0, 0].astype(np.float64)
        np.testing.assert_allclose(xyz[:2] / xyz.sum(), (x, y), atol=1e-5)
    white, _ = display.shown_light(grey(1.0))
    np.testing.assert_allclose(white[:, 0, 0], 1, atol=1e-5)
    other, _ = DisplayRecipe(white=(0.34, 0.35)).shown_light(grey(1.0))
    xyz = to_xyz @ other[:, 0, 0].astype(np.float64)
    np.testing.assert_allclose(xyz[:2] / xyz.sum(), (0.34, 0.35), atol=1e-5)


def test_gamma_is_a_power_of_the_codes():
    light, _ = DisplayRecipe(gamma=2.0, contrast=1e9).shown_light(decode_srgb(grey(51 / 255)))
    np.testing.assert_allclose(light, 0.04, rtol=1e-4)


def test_without_calibration_the_truth_is_the_picture_as_coded():
    picture = np.random.default_rng(1).uniform(0, 1, (3, 4, 4)).astype(np.float32)
    display = DisplayRecipe(primaries=WIDE, contrast=100.0, gamma=2.4, calibrated=False)
    light, truth = display.shown_light(picture)
    np.testing.assert_allclose(truth, decode_srgb(display.codes(picture)), atol=1e-7)
    assert np.abs(light - truth).max() > 0.01


def test_daylight_of_6504_k_is_d65_and_keeps_luminance():
    np.testing.assert_allclose(daylight(6504), 1, atol=2e-3)
    for kelvin in (4000.0, 7000.0, 25000.0):
        assert LUMINANCE @ daylight(kelvin) == pytest.approx(1, abs=1e-9)
    # chromaticities that the CIE prints for D50 and D75
    for kelvin, x, y in ((5003, 0.3457, 0.3585), (7504, 0.2990, 0.3149)):
        xyz = rgb_to_xyz(REC709_PRIMARIES, D65) @ daylight(kelvin)
        np.testing.assert_allclose(xyz[:2] / xyz.sum(), (x, y), atol=3e-4)
    red = [daylight(kelvin)[0] / daylight(kelvin)[2] for kelvin in (4000, 6504, 25000)]
    assert red[0] > red[1] > red[2]


def test_range_raises_white_and_leaves_shadows():
    scene = with_range(grey(1.0, 0.18, 0.02), 64.0)
    np.testing.assert_allclose(scene[0, 0], (64, 0.18 * (1 + 63 * 0.18**4), 0.02), rtol=1e-4)
    assert scene[0, 0, 1] < 0.18 * 1.07
    colour = np.array([0.9, 0.5, 0.1], np.float32).reshape(3, 1, 1)
    raised = with_range(colour, 16.0)
    np.testing.assert_allclose(raised / raised.sum(), colour / colour.sum(), rtol=1e-5)


def test_wild_scenes_reach_their_range_and_no_farther():
    white = grey(1.0)
    rng = np.random.default_rng(0)
    times = [float(WildRecipe(daylight_share=0.0).lit(rng, white).max()) for _ in range(200)]
    assert 3.99 < min(times) < 5
    assert 50 < max(times) < 64.1
    still = WildRecipe(daylight_share=0.0, range_share=0.0).lit(rng, white)
    np.testing.assert_array_equal(still, white)


def test_recipes_without_the_tables_keep_the_names_of_their_samples(recipe):  # noqa: F811
    assert not {"display", "wild"} & set(recipe.data.to_json())
    shown = read("\n[data.display]\ncontrast = 500.0\n")
    assert shown.data.display == DisplayRecipe(contrast=500.0)
    assert json.dumps(shown.data.to_json()) != json.dumps(recipe.data.to_json())


def test_samples_are_of_the_display_and_their_truth_too(recipe, bank):  # noqa: F811
    def sample(tables):
        given = read(tables)
        return BayerMaker(given, bank, None, 5).developed(3)

    plain = BayerMaker(recipe, bank, None, 5).developed(3)
    black = sample("\n[data.display]\ncontrast = 4.0\n")
    coded = sample("\n[data.display]\ncontrast = 4.0\ncalibrated = false\n")
    for dim, contrast in ((plain, 6), (black, 10)):
        enough = float(dim.true.max() / dim.true.min()) < contrast
        assert enough == (dim is black)
    assert float((coded.true - plain.true).abs().mean()) < 0.02
    assert float((coded.planes - black.planes).abs().max()) == 0
    wild = sample("\n[data.wild]\nrange_least = 16.0\n")
    assert float(wild.true.max()) > float(plain.true.max())


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ("[data.display]\ncontrast = 1.0", "contrast > 1"),
        ("[data.display]\nwhite = [0.3]", r"each \[x, y\]"),
        ("[data.display]\nprimaries = [[0.3, 0.3], [0.3, 0.3], [0.1, 0.1]]", "triangle"),
        ("[data.display]\nbright = 1.0", r"data\.display: unknown key 'bright'"),
        ("[data.wild]\ndaylight_warmest_k = 2000.0", "daylight_warmest_k"),
        ("[data.wild]\nrange_least = 0.5", "range_least"),
        ("[data.display]\n[data.wild]", "not both"),
    ],
)
def test_wrong_light_is_refused(tables, message):
    with pytest.raises(ContractError, match=message):
        read(f"\n{tables}\n")


def test_a_display_or_none(recipe):  # noqa: F811
    scene = np.random.default_rng(2).uniform(0, 3, (3, 4, 4)).astype(np.float32)
    light, truth = recipe.data.lit(np.random.default_rng(0), scene)
    assert light is scene
    assert truth is scene
    shown = dataclasses.replace(recipe.data, display=DisplayRecipe())
    assert shown.lit(np.random.default_rng(0), scene)[0].max() <= 1 + 1e-6
