"""Layers of a capture add up to it; each role is given and asked what it should be."""

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.samples import spread_light
from camkit.models_def.kinds.hdr.scenes import open_lights
from camkit.models_def.kinds.hdr.thesis.coded_samples import (
    PORTS,
    CodedCamera,
    CodedMaker,
    coded_sample,
    layout_of,
)
from camkit.models_def.kinds.hdr.thesis.networks import to_light
from camkit.models_def.training.recipe import SceneRecipe

SIDE, SURROUND = 96, 8


def lamp_scene(light=60.0):
    """Give a dim scene with one lamp in the middle."""
    scene = np.full((3, SIDE + 2 * SURROUND, SIDE + 2 * SURROUND), 0.2, np.float32)
    middle = scene.shape[1] // 2
    scene[:, middle - 2 : middle + 3, middle - 2 : middle + 3] = light
    return scene


def on_ring(shot):
    """Give the green streaks of the pixels 30 away from the lamp."""
    y, x = np.mgrid[:SIDE, :SIDE] - SIDE // 2
    return shot.streaks[1][np.abs(np.hypot(y, x) - 30) < 1]


@pytest.fixture
def shoot(small_recipe, streaks):
    def make(optics="plate", light=60.0):
        recipe = small_recipe(optics=optics)
        camera = CodedCamera(recipe, streaks)
        return recipe, camera.photograph(lamp_scene(light), 100.0, np.random.default_rng(1))

    return make


def test_streaks_are_what_the_arms_write_and_end_at_white(shoot):
    _, shot = shoot()
    assert shot.rgb.shape == shot.sharp.shape == shot.streaks.shape == (3, SIDE, SIDE)
    ring = on_ring(shot)
    assert ring.max() > 20 * np.median(ring)
    assert 0 <= shot.streaks.min() <= shot.streaks.max() <= 1
    # in the middle of the lamp they are what ordinary light leaves to white
    assert shot.clipped[48, 48]
    assert shot.streaks[1, 48, 48] == pytest.approx(0.0, abs=0.1)


def test_a_capture_is_its_ordinary_light_and_its_streaks(small_recipe, streaks, shoot):
    recipe, shot = shoot()
    kernels = CodedCamera(recipe, streaks).kernels(np.random.default_rng(0))
    ordinary = spread_light(torch.from_numpy(shot.sharp)[None].clamp(max=1), kernels)[0].numpy()
    smooth = ~shot.clipped & (np.abs(np.arange(SIDE) - 48) > 12)[None]
    smooth[:12], smooth[-12:] = False, False
    gap = (shot.rgb - ordinary - shot.streaks)[:, smooth]
    assert abs(float(gap.mean())) < 2e-3
    assert float(shot.streaks[:, smooth].mean()) > 2e-3


def test_a_scene_without_lights_has_no_streaks(shoot):
    _, shot = shoot(light=0.8)
    assert shot.streaks.max() == pytest.approx(0, abs=1e-6)
    assert not shot.clipped.any()


def test_the_bare_lens_writes_none_and_a_windshield_writes_them_upright(shoot):
    _, bare = shoot("bare")
    assert on_ring(bare).max() < 1e-3
    _, glare = shoot("glare")
    upright = glare.streaks[1, 48 + 25, 40:57].max()
    assert upright > 1e-3
    assert upright > 20 * glare.streaks[1, 40:57, 48 + 25].max()


def test_roles_hold_roots_of_the_layers(shoot):
    recipe, shot = shoot()
    corner = (16, 16)
    sharp = torch.from_numpy(shot.sharp[:, 16:80, 16:80])
    made = {role: coded_sample(shot, corner, recipe, role) for role in PORTS}
    for role, sample in made.items():
        sample.stacked(layout_of(recipe, role))
    clean, streaks = to_light(made["split"].target).split(3)
    assert torch.allclose(clean, sharp.clamp(max=1), atol=1e-6)
    assert torch.allclose(to_light(made["highlight"].inputs["streaks"]), streaks, atol=1e-6)
    lights = to_light(made["highlight"].target)
    assert (float(lights.min()), float(lights.max())) == (1, pytest.approx(60, rel=0.2))
    masked = to_light(made["fusion"].inputs["lights"])
    open_ = to_light(made["split"].inputs["rgb"]).amax(0) < 0.99
    assert float(masked[:, open_].max()) == 0
    assert torch.allclose(masked[:, ~open_], lights[:, ~open_], atol=1e-4)
    assert torch.allclose(to_light(made["whole"].target), sharp, rtol=1e-4)


def test_only_samples_behind_a_windshield_may_not_be_turned(small_recipe):
    assert layout_of(small_recipe(), "split").turned
    assert not layout_of(small_recipe(optics="glare"), "split").turned


def test_a_sample_is_a_function_of_seed_and_number(small_recipe, streaks):
    recipe = small_recipe()

    def make(seed, index):
        source = open_lights(
            SceneRecipe(picture_share=0.0, procedural_scenes=1, scene_px=128), None
        )
        maker = CodedMaker(recipe, "whole", CodedCamera(recipe, streaks), source, seed)
        return maker.make(index).stacked(layout_of(recipe, "whole"))

    one = make(1, 0)
    assert torch.equal(one, make(1, 0))
    assert not torch.equal(one, make(1, 1))
    assert not torch.equal(one, make(2, 0))


def test_an_unknown_role_is_refused(small_recipe, streaks):
    recipe = small_recipe()
    source = open_lights(SceneRecipe(picture_share=0.0, procedural_scenes=1, scene_px=128), None)
    with pytest.raises(ContractError, match="one of split, highlight, fusion, whole; got 'all'"):
        CodedMaker(recipe, "all", CodedCamera(recipe, streaks), source, 1)
