"""Recipes of single-photon cameras; the shipped ones among them."""

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.recipe import SpadRecipe, samples_digest, to_spad_recipe

RECIPES = Path(__file__).resolve().parents[4] / "models_def" / "recipes"

Change = Callable[..., dict[str, Any]]


@pytest.mark.parametrize(
    ("name", "role", "sizes"),
    [
        ("spad_sr_psf", "plate", {"S"}),
        ("spad_sr", "upscale", {"S", "M", "dbpn", "srcnn", "vdsr"}),
    ],
)
def test_shipped_recipes_are_of_one_array(name: str, role: str, sizes: set[str]) -> None:
    recipe = to_spad_recipe(tomllib.loads((RECIPES / f"{name}.toml").read_text(encoding="utf-8")))
    assert set(recipe.networks) == {role}
    assert set(recipe.networks[role]) == sizes
    sensor = recipe.sensor
    assert (sensor.width_px, sensor.height_px, sensor.pixel_pitch_um) == (64, 32, 150)
    assert (recipe.sensor.sub_pixels, recipe.sensor.phase) == (4, 2)
    assert recipe.data.told


def test_a_network_without_role_makes_pictures_finer(tiny: SpadRecipe) -> None:
    assert set(tiny.networks) == {"upscale", "plate"}
    assert tiny.data.exposure(50.0).white_counts == 50


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sensor__type": "planes"}, r"sensor\."),
        ({"sampling__mode": "round"}, "sampling.mode must be one of low_fill"),
        ({"sampling__mode": "learned"}, "sampling.psf belongs to the mode learned"),
        ({"sampling__psf": "x.pt"}, "sampling.psf belongs to the mode learned"),
        ({"sampling__mode": "low_fill", "sampling__sigma": 2.0}, "sampling.sigma belongs"),
        ({"sensor__phase": 4}, r"phase must be one of the sub-pixels 0\.\.3"),
        ({"sensor__sub_pixels": 5}, r"sensor.sub_pixels must be 4, got 5"),
        ({"sampling__side": 4}, "sampling: unknown key 'side'"),
        ({"data__photons_min": 0.0}, "data.photons_min"),
        ({"data__photons_min": 1e9}, "data.photons_min"),
        ({"data__detected": 2.0}, "detected in"),
        ({"data__dark_counts": -1.0}, "dark_counts"),
        ({"data__told": 1}, "data.told must be true or false"),
        ({"lens": {}}, "unknown key 'lens'"),
    ],
)
def test_a_wrong_key_is_named(changes: dict[str, Any], message: str, changed: Change) -> None:
    with pytest.raises(ContractError, match=message):
        to_spad_recipe(changed(**changes))


def test_a_sensor_that_counts_no_photons_is_refused(changed: Change) -> None:
    bayer = tomllib.loads((RECIPES / "streak_hdr.toml").read_text(encoding="utf-8"))["sensor"]
    with pytest.raises(ContractError, match=r'sensor\.type must be "spad", got "bayer"'):
        to_spad_recipe(changed() | {"sensor": bayer})


def test_samples_are_named_by_all_that_decides_them(changed: Change) -> None:
    def digest(role: str = "upscale", seed: int = 1, **changes: Any) -> str:
        return samples_digest(to_spad_recipe(changed(**changes)), role, seed)

    different = {
        digest(),
        digest(seed=2),
        digest(role="plate"),
        digest(sampling__mode="low_fill"),
        digest(data__photons_max=2e4),
        digest(data__told=False),
    }
    assert len(different) == 6
    assert digest(name="other", schedule__steps=9) == digest()
