"""Scenes with lights: nights, pictures with the lights of a night, exposed as asked."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.models_def.kinds.hdr.samples import HdrCamera
from camkit.models_def.kinds.hdr.scenes import DUSK_EV, NIGHT_SEED, exposed, open_lights
from camkit.models_def.training.recipe import SceneRecipe
from camkit.runtime.kinds.hdr.night import night_scene
from camkit.scenes.saturation import CEILING

SIDE = 96


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((240, 240, 3), 188, np.uint8))
    return tmp_path


def test_without_pictures_every_scene_is_a_night_that_is_never_measured_on() -> None:
    source = open_lights(SceneRecipe(picture_share=1.0, procedural_scenes=1, scene_px=160), None)
    rng, again = np.random.default_rng(3), np.random.default_rng(3)
    night = NIGHT_SEED + int(again.integers(2**31))
    np.testing.assert_array_equal(source.draw(rng, SIDE), night_scene(night, SIDE, SIDE))


def test_a_picture_is_darkened_and_holds_the_lights_of_a_night(pictures: Path) -> None:
    source = open_lights(
        SceneRecipe(picture_share=1.0, procedural_scenes=1, scene_px=160), pictures
    )
    seen = 0
    for seed in range(4):
        rng, again = np.random.default_rng(seed), np.random.default_rng(seed)
        scene = source.draw(rng, SIDE)
        night = night_scene(NIGHT_SEED + int(again.integers(2**31)), SIDE, SIDE)
        lit = (night > 1).any(axis=0)
        np.testing.assert_array_equal(scene[:, lit], night[:, lit])
        grey = ((188 / 255 + 0.055) / 1.055) ** 2.4
        dusk = np.log2(scene[:, ~lit] / grey)
        assert dusk.max() - dusk.min() < 0.1
        assert DUSK_EV[0] - 0.1 < dusk.mean() < DUSK_EV[1] + 0.1
        seen += lit.any()
    assert seen


def test_the_share_of_pictures_is_kept(pictures: Path) -> None:
    source = open_lights(
        SceneRecipe(picture_share=0.0, procedural_scenes=1, scene_px=160), pictures
    )
    rng, again = np.random.default_rng(3), np.random.default_rng(3)
    night = NIGHT_SEED + int(again.integers(2**31))
    np.testing.assert_array_equal(source.draw(rng, SIDE), night_scene(night, SIDE, SIDE))


@pytest.mark.parametrize("share", [0.01, 0.05])
def test_a_scene_is_exposed_so_that_a_share_of_it_saturates(
    share: float, camera: HdrCamera
) -> None:
    scene = night_scene(11, 128, 128)
    got = exposed(scene, camera.matrix, camera.gains, share)
    raw = np.einsum("ij,jyx->iyx", camera.matrix, got) / np.array(camera.gains)[:, None, None]
    assert (raw >= 1).any(axis=0).mean() == pytest.approx(share, rel=0.2)
    assert got.max() <= CEILING


def test_a_scene_as_it_is_or_too_dark_to_saturate_is_not_changed(camera: HdrCamera) -> None:
    scene = night_scene(11, 128, 128)
    as_it_is = exposed(scene, camera.matrix, camera.gains, None)
    np.testing.assert_array_equal(as_it_is, np.minimum(scene, CEILING))
    black = np.zeros((3, 16, 16), np.float32)
    np.testing.assert_array_equal(exposed(black, camera.matrix, camera.gains, 0.1), black)
