"""A sample is a scene as the camera takes it, its lights found, cut about a light."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.models_def.kinds.hdr.recipe import HdrRecipe
from camkit.models_def.kinds.hdr.samples import LAYOUT, HdrCamera, Shot, draw_corner, sample_of
from camkit.models_def.sensors.stabilise import unstabilise
from camkit.scenes.saturation import CEILING

SURROUND = 16


@pytest.fixture(scope="module")
def shot(camera: HdrCamera) -> Shot:
    scene = np.full((3, 160, 160), 0.15, np.float32)
    y, x = np.indices((160, 160))
    scene += 60 * np.exp(-0.5 * ((y - 60) ** 2 + (x - 96) ** 2) / 2.5**2).astype(np.float32)
    return camera.photograph(scene, 100.0, np.random.default_rng(0), SURROUND)


def _db(found: np.ndarray, truth: np.ndarray) -> float:
    gap = np.clip(found, 0, CEILING) - np.minimum(truth, CEILING)
    return float(10 * np.log10(CEILING**2 / np.mean(gap**2, dtype=np.float64)))


def test_a_shot_holds_the_capture_without_its_surround(shot: Shot, camera: HdrCamera) -> None:
    for planes in (shot.rgb, shot.lit, shot.sharp):
        assert planes.shape == (3, 128, 128)
        assert planes.dtype == np.float32
    assert shot.clipped.shape == (128, 128)
    assert shot.clipped[44, 80]
    assert 0 < shot.clipped.mean() < 0.05
    assert shot.sharp[:, 44, 80].max() > 40
    assert shot.rgb.max() < 1.2 * max(camera.gains)
    assert shot.noise.shot == camera.recipe.sensor.noise_at(100.0).with_gains(camera.gains).shot


def test_the_lights_of_a_shot_are_found_by_physics(shot: Shot) -> None:
    assert _db(shot.lit, shot.sharp) > _db(shot.rgb, shot.sharp) + 4
    around = np.s_[:, 34:55, 70:91]
    assert shot.lit[around].sum() == pytest.approx(shot.sharp[around].sum(), rel=0.2)


def test_light_from_the_surround_falls_into_the_capture(camera: HdrCamera) -> None:
    rng = np.random.default_rng(0)
    dark = np.full((3, 160, 160), 0.05, np.float32)
    lamp = dark.copy()
    lamp[:, 78:82, 4:8] = 200
    without, beside = (camera.photograph(s, 100.0, rng, SURROUND) for s in (dark, lamp))
    np.testing.assert_allclose(without.sharp, beside.sharp)
    assert beside.rgb[:, :, :24].mean() > without.rgb[:, :, :24].mean() * 1.05


def test_the_same_generator_gives_the_same_bits(camera: HdrCamera) -> None:
    scene = np.full((3, 96, 96), 0.3, np.float32)
    one, same, other = (
        camera.photograph(scene, 400.0, np.random.default_rng(seed), 8) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.lit, same.lit)
    assert (one.lit != other.lit).any()


def test_a_sample_is_the_cut_shot_stabilised(shot: Shot, tiny: HdrRecipe) -> None:
    sample = sample_of(shot, (20, 40), tiny)
    side = tiny.data.sample_px
    assert {port.name for port in LAYOUT.inputs} == set(sample.inputs)
    assert sample.target.shape == (3, side, side)
    shots, reads = torch.tensor(shot.noise.shot), torch.tensor(shot.noise.read_variance)
    for planes, stable in ((shot.rgb, sample.inputs["rgb"]), (shot.sharp, sample.target)):
        light = unstabilise(stable[None], shots, reads, scale=tiny.scale)[0].numpy()
        cut = planes[:, 20 : 20 + side, 40 : 40 + side]
        bright = cut > 0.02
        np.testing.assert_allclose(light[bright], cut[bright], rtol=1e-3)
    whole = sample_of(shot, (0, 0), tiny, side_px=128)
    assert whole.inputs["lit"].shape == (3, 128, 128)
    torch.testing.assert_close(sample.weight, tiny.scale * shots.sqrt())


def test_samples_are_cut_about_lights_as_often_as_asked(shot: Shot, tiny: HdrRecipe) -> None:
    rng = np.random.default_rng(5)
    side = tiny.data.sample_px

    def share(recipe: HdrRecipe, of: Shot) -> float:
        held = []
        for _ in range(60):
            top, left = draw_corner(rng, of, recipe)
            assert 0 <= top <= 128 - side
            assert 0 <= left <= 128 - side
            held.append(of.clipped[top : top + side, left : left + side].any())
        return float(np.mean(held))

    always = replace(tiny, data=replace(tiny.data, light_share=1.0))
    never = replace(tiny, data=replace(tiny.data, light_share=0.0))
    assert share(always, shot) == 1
    anywhere = share(never, shot)
    assert 0.2 < anywhere < 1
    corner = replace(shot, clipped=np.zeros_like(shot.clipped))
    assert share(always, corner) == 0
