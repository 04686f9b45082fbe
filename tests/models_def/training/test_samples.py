from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.training.psf_bank import PsfBank
from camkit.models_def.training.samples import (
    Exposure,
    corner_height_mm,
    draw_exposure,
    make_sample,
    scene_side_px,
)
from camkit.scenes import procedural_scene

CENTRE = Exposure(x_mm=0.0, y_mm=0.0, block_x_mm=0.0, block_y_mm=0.0, copy=0, iso=100.0)


@pytest.fixture
def sharp_bank(bank):
    """A lens without blur."""
    delta = np.zeros((2, 2, 3, 5, 5), dtype=np.float32)
    delta[..., 2, 2] = 1
    return PsfBank(
        copies=delta,
        copy_heights_mm=np.array([0.0, 2.0]),
        frozen=delta[0],
        frozen_heights_mm=np.array([0.0, 2.0]),
        relative_illumination=np.array([1.0, 0.5]),
    )


def grey(recipe, bank, value):
    side = scene_side_px(recipe, bank)
    return np.full((3, side, side), value, dtype=np.float32)


@pytest.mark.parametrize("iso", [100.0, 400.0, 1600.0])
def test_noise_of_stabilised_samples_is_half_over_scale_at_any_iso(recipe, sharp_bank, iso):
    exposure = replace(CENTRE, iso=iso)
    rng = np.random.default_rng(3)
    sample = make_sample(grey(recipe, sharp_bank, 0.3), exposure, recipe, sharp_bank, rng)
    noise = (sample.planes[:3] - sample.target).numpy()
    # The demosaic passes a third to all of the noise of a pixel: look where red was measured.
    assert noise[0, ::2, ::2].std() == pytest.approx(0.5 / recipe.scale, rel=0.08)
    assert abs(noise.mean()) < 0.1 * 0.5 / recipe.scale


def test_without_blur_and_with_little_noise_the_target_is_the_capture(recipe, sharp_bank):
    # A smooth scene, so that the demosaic is exact.
    side = scene_side_px(recipe, sharp_bank)
    ramp = np.linspace(0.2, 0.6, side, dtype=np.float32)
    crop = np.stack([np.tile(ramp, (side, 1))] * 3)
    exposure = replace(CENTRE, iso=1e-3)
    sample = make_sample(crop, exposure, recipe, sharp_bank, np.random.default_rng(0))
    top = float(sample.target.max())
    assert float((sample.planes[:3] - sample.target).abs().max()) < 1e-3 * top


def test_weight_takes_planes_to_the_root_of_the_signal(recipe, sharp_bank):
    rng = np.random.default_rng(0)
    sample = make_sample(grey(recipe, sharp_bank, 0.25), CENTRE, recipe, sharp_bank, rng)
    root = (sample.target * sample.weight[:, None, None]).mean((1, 2))
    floor = torch.tensor(sample.noise.read_variance) / torch.tensor(sample.noise.shot)
    assert torch.allclose(root, torch.sqrt(0.25 + floor), rtol=1e-4)


def test_vignetting_is_in_capture_and_target_alike(recipe, sharp_bank):
    exposure = replace(CENTRE, x_mm=1.0, block_x_mm=1.0)
    rng = np.random.default_rng(0)
    sample = make_sample(grey(recipe, sharp_bank, 0.4), exposure, recipe, sharp_bank, rng)
    assert sample.illumination == pytest.approx(0.75)
    gap = (sample.planes[:3] - sample.target).mean()
    assert abs(float(gap)) < 1e-3 * float(sample.target.mean())


def test_clipped_highlights_are_not_judged(recipe, sharp_bank):
    crop = grey(recipe, sharp_bank, 0.3)
    middle = crop.shape[-1] // 2
    crop[:, middle - 3 : middle + 3, middle - 3 : middle + 3] = 3.0
    sample = make_sample(crop, CENTRE, recipe, sharp_bank, np.random.default_rng(0))
    lost = (sample.target < 0).numpy()
    half = recipe.data.sample_px // 2
    assert lost[:, half - 2 : half + 2, half - 2 : half + 2].all()
    assert lost.mean() < 0.05


def test_blurred_samples_are_blurred_and_wiener_brings_them_closer(recipe, bank):
    crop = procedural_scene(8, scene_side_px(recipe, bank), scene_side_px(recipe, bank))
    crop = np.clip(crop, 0, 0.9)
    sample = make_sample(crop, CENTRE, recipe, bank, np.random.default_rng(0))
    capture = float((sample.planes[:3] - sample.target).square().mean())
    wiener = float((sample.planes[3:] - sample.target).square().mean())
    assert wiener < 0.8 * capture


def test_picture_borders_show_mirrored_content_and_leave_the_middle_alone(recipe, bank):
    crop = np.clip(procedural_scene(8, *[scene_side_px(recipe, bank)] * 2), 0, 0.9)
    inside = make_sample(crop, CENTRE, recipe, bank, np.random.default_rng(0))
    border = replace(CENTRE, borders=(True, False, False, False))
    edge = make_sample(crop, border, recipe, bank, np.random.default_rng(0))
    assert torch.equal(edge.planes[:3, 4:], inside.planes[:3, 4:])
    assert torch.equal(edge.target, inside.target)
    change = (edge.planes[3:] - inside.planes[3:]).abs().mean((0, 2))
    assert float(change[:8].mean()) > 4 * float(change[-16:].mean())


def test_samples_depend_on_nothing_but_their_generator(recipe, bank):
    crop = procedural_scene(2, scene_side_px(recipe, bank), scene_side_px(recipe, bank))
    first = make_sample(crop, CENTRE, recipe, bank, np.random.default_rng(4))
    again = make_sample(crop, CENTRE, recipe, bank, np.random.default_rng(4))
    other = make_sample(crop, CENTRE, recipe, bank, np.random.default_rng(5))
    assert torch.equal(first.planes, again.planes)
    assert not torch.equal(first.planes, other.planes)


def test_drawn_exposures_stay_in_their_ranges(recipe, bank):
    rng = np.random.default_rng(0)
    drawn = [draw_exposure(rng, recipe, bank) for _ in range(400)]
    data = recipe.data
    assert all(data.iso_min <= e.iso <= data.iso_max for e in drawn)
    assert all(2**data.exposure_min_ev <= e.factor <= 2**data.exposure_max_ev for e in drawn)
    assert {e.copy for e in drawn} == set(range(bank.training_copies))
    heights = [np.hypot(e.x_mm, e.y_mm) for e in drawn]
    assert max(heights) <= corner_height_mm(recipe)
    at_border = np.mean([any(e.borders) for e in drawn])
    assert 0.1 < at_border <= data.border_share + 0.05


def test_crop_of_another_size_is_refused(recipe, bank):
    with pytest.raises(ContractError, match="a crop must be"):
        make_sample(np.zeros((3, 8, 8), np.float32), CENTRE, recipe, bank, np.random.default_rng(0))
