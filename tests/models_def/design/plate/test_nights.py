"""Patches of nights: exposed as the camera says, about lights, drawn from the generator alone."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.design.plate.nights import TRAIN_SEED, VALID_SEED, Nights
from camkit.models_def.kinds.hdr.recipe import HdrRecipe, to_hdr_recipe
from tests.models_def.design.plate.joint_recipe import camera_text


@pytest.fixture(scope="module")
def camera() -> HdrRecipe:
    found = to_hdr_recipe(tomllib.loads(camera_text()))
    return replace(found, data=replace(found.data, sample_px=32, capture_px=32))


@pytest.fixture(scope="module")
def nights(camera: HdrRecipe) -> Nights:
    return Nights(camera, first_seed=VALID_SEED, count=2, scene_px=160, psf_px=41)


def test_draws_follow_from_the_generator_alone(nights: Nights) -> None:
    first, again, other = (nights.draw(np.random.default_rng(seed), 3) for seed in (1, 1, 2))
    assert first.sharp.shape == (3, 3, 72, 72)
    assert first.normal.shape == (3, 32, 32)
    assert torch.equal(first.sharp, again.sharp)
    assert torch.equal(first.normal, again.normal)
    assert torch.equal(first.shot, again.shot)
    assert not torch.equal(first.sharp, other.sharp)


def test_patches_hold_lights_and_have_the_noise_of_the_camera(
    nights: Nights, camera: HdrRecipe
) -> None:
    drawn = nights.draw(np.random.default_rng(3), 24)
    inner = drawn.sharp[..., 20:52, 20:52]
    clipped = inner > torch.tensor(nights.pixels.gains).reshape(3, 1, 1)
    held = clipped.any(1).flatten(1).any(1).float().mean()
    assert float(held) >= 0.8
    assert 1 < float(inner.max()) <= 300
    low, high = (camera.sensor.noise_at(iso).shot[0] for iso in (80.0, 3200.0))
    assert low <= float(drawn.shot.min()) < float(drawn.shot.max()) <= high


def test_scenes_saturate_as_much_as_the_camera_says(nights: Nights) -> None:
    night = nights._night(0)
    fill = night.light.astype(np.float32) / np.array(nights.pixels.gains)[:, None, None]
    assert 0.009 <= (fill > 1).any(axis=0).mean() <= 0.033
    assert night.clipped.shape == (120, 120)


def test_seeds_of_training_of_holding_out_and_of_measuring_are_apart() -> None:
    assert VALID_SEED > 1_000_000
    assert TRAIN_SEED - VALID_SEED >= 1_000_000


def test_a_scene_that_is_as_it_is_is_not_exposed(camera: HdrRecipe) -> None:
    as_it_is = replace(camera, data=replace(camera.data, as_it_is_share=1.0))
    made = [
        Nights(chosen, first_seed=VALID_SEED, count=1, scene_px=96, psf_px=41)._night(0).light
        for chosen in (as_it_is, camera)
    ]
    assert made[0].shape == made[1].shape
    assert not np.array_equal(*made)


def test_a_scene_too_small_for_patch_and_psf_is_refused(camera: HdrRecipe) -> None:
    with pytest.raises(ContractError, match="scene_px >= 72; got 71"):
        Nights(camera, first_seed=1, count=1, scene_px=71, psf_px=41)
