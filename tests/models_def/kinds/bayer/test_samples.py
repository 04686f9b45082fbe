from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.bundle.stages import Dehaze, Mosaic
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.models_def.kinds.bayer.samples import (
    LAYOUT,
    Exposure,
    corner_height_mm,
    draw_exposure,
    filtered,
    make_shot,
    photograph,
    scene_side_px,
)
from camkit.models_def.sensors.stabilise import unstabilise
from camkit.runtime.bank.blocks import Block, taper_edges, to_otf
from camkit.runtime.bank.wiener import wiener_filter
from camkit.scenes import procedural_scene
from tests.together_factory import TOGETHER

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
    shot = make_shot(grey(recipe, sharp_bank, 0.3), exposure, recipe, sharp_bank, rng)
    noise = (shot.sample.inputs["capture"] - shot.sample.target).numpy()
    # The demosaic passes a third to all of the noise of a pixel: look where red was measured.
    assert noise[0, ::2, ::2].std() == pytest.approx(0.5 / recipe.scale, rel=0.08)
    assert abs(noise.mean()) < 0.1 * 0.5 / recipe.scale


def with_wells(sensor, factor):
    """Give a sensor whose pixels hold so many times the electrons."""
    noise = tuple(
        entry.model_copy(update={"gain_e_per_dn": factor * entry.gain_e_per_dn})
        for entry in sensor.noise
    )
    return sensor.model_copy(update={"noise": noise, "full_well_e": factor * sensor.full_well_e})


def test_without_blur_and_with_little_noise_the_target_is_the_capture(recipe, sharp_bank):
    # A smooth scene, so that the demosaic is exact.
    side = scene_side_px(recipe, sharp_bank)
    ramp = np.linspace(0.2, 0.6, side, dtype=np.float32)
    crop = np.stack([np.tile(ramp, (side, 1))] * 3)
    quiet = replace(recipe, sensor=with_wells(recipe.sensor, 1e5))
    shot = make_shot(crop, CENTRE, quiet, sharp_bank, np.random.default_rng(0))
    top = float(shot.sample.target.max())
    assert float((shot.sample.inputs["capture"] - shot.sample.target).abs().max()) < 1e-3 * top


def test_weight_takes_planes_to_the_root_of_the_signal(recipe, sharp_bank):
    rng = np.random.default_rng(0)
    shot = make_shot(grey(recipe, sharp_bank, 0.25), CENTRE, recipe, sharp_bank, rng)
    root = (shot.sample.target * shot.sample.weight[:, None, None]).mean((1, 2))
    floor = torch.tensor(shot.noise.read_variance) / torch.tensor(shot.noise.shot)
    assert torch.allclose(root, torch.sqrt(0.25 + floor), rtol=1e-4)


def test_vignetting_is_in_capture_and_target_alike(recipe, sharp_bank):
    exposure = replace(CENTRE, x_mm=1.0, block_x_mm=1.0)
    rng = np.random.default_rng(0)
    shot = make_shot(grey(recipe, sharp_bank, 0.4), exposure, recipe, sharp_bank, rng)
    assert shot.illumination == pytest.approx(0.75)
    gap = (shot.sample.inputs["capture"] - shot.sample.target).mean()
    assert abs(float(gap)) < 1e-3 * float(shot.sample.target.mean())


def test_clipped_highlights_stay_as_the_bank_has_them(recipe, sharp_bank):
    crop = grey(recipe, sharp_bank, 0.3)
    middle = crop.shape[-1] // 2
    crop[:, middle - 3 : middle + 3, middle - 3 : middle + 3] = 3.0
    shot = make_shot(crop, CENTRE, recipe, sharp_bank, np.random.default_rng(0))
    half = recipe.data.sample_px // 2
    inner = np.s_[:, half - 2 : half + 2, half - 2 : half + 2]
    kept = (shot.sample.target == shot.sample.inputs["wiener"]).numpy()
    assert kept[inner].all()
    assert kept.mean() < 0.05
    assert (shot.sample.target >= 0).all()


def test_blurred_samples_are_blurred_and_wiener_brings_them_closer(recipe, bank):
    crop = procedural_scene(8, scene_side_px(recipe, bank), scene_side_px(recipe, bank))
    crop = np.clip(crop, 0, 0.9)
    shot = make_shot(crop, CENTRE, recipe, bank, np.random.default_rng(0))
    capture = float((shot.sample.inputs["capture"] - shot.sample.target).square().mean())
    wiener = float((shot.sample.inputs["wiener"] - shot.sample.target).square().mean())
    assert wiener < 0.8 * capture


def test_picture_borders_show_mirrored_content_and_leave_the_middle_alone(recipe, bank):
    crop = np.clip(procedural_scene(8, *[scene_side_px(recipe, bank)] * 2), 0, 0.9)
    inside = make_shot(crop, CENTRE, recipe, bank, np.random.default_rng(0))
    border = replace(CENTRE, borders=(True, False, False, False))
    edge = make_shot(crop, border, recipe, bank, np.random.default_rng(0))
    assert torch.equal(edge.sample.inputs["capture"][:, 4:], inside.sample.inputs["capture"][:, 4:])
    assert torch.equal(edge.sample.target, inside.sample.target)
    change = (edge.sample.inputs["wiener"] - inside.sample.inputs["wiener"]).abs().mean((0, 2))
    assert float(change[:8].mean()) > 4 * float(change[-16:].mean())


@pytest.mark.parametrize("borders", [(False,) * 4, (True, False, True, False)])
def test_the_bank_of_samples_near_the_axis_works_on_their_mosaic(recipe, bank, borders):
    near = recipe.wiener.model_copy(update={"together": TOGETHER, "mosaic": Mosaic(within_mm=1.0)})
    recipe, crop = replace(recipe, wiener=near), grey(recipe, bank, 0.0)
    crop[:] = np.clip(procedural_scene(8, *crop.shape[1:]), 0, 0.9)
    exposure = replace(CENTRE, borders=borders)
    shot = photograph(crop, exposure, recipe, bank, np.random.default_rng(0))
    given, planes = shot.circumstances, shot.planes[0].numpy()
    assert given.red == (0, 0)
    otf = to_otf(given.frozen[0].numpy(), planes.shape[-1])
    tapered = taper_edges(planes, otf, near.overlap_px // 4)
    block = Block(samples=tapered, otf=otf, red=given.red)
    expected = wiener_filter(near, given.noise)(block)
    np.testing.assert_array_equal(filtered(shot, recipe)[0].numpy(), expected)
    apart = replace(shot, circumstances=replace(given, height_mm=1.5))
    by_planes = filtered(replace(apart, circumstances=replace(given, red=None)), recipe)
    assert not torch.equal(filtered(apart, recipe), filtered(shot, recipe))
    torch.testing.assert_close(
        by_planes, filtered(shot, replace(recipe, wiener=near.model_copy(update={"mosaic": None})))
    )


def test_tiles_of_a_lens_with_a_haze_have_no_mosaic(recipe):
    near = recipe.wiener.model_copy(update={"together": TOGETHER, "mosaic": Mosaic(within_mm=1.0)})
    with pytest.raises(ContractError, match=r"leave wiener\.mosaic out"):
        replace(recipe, wiener=near, haze=Dehaze())


def test_samples_depend_on_nothing_but_their_generator(recipe, bank):
    crop = procedural_scene(2, scene_side_px(recipe, bank), scene_side_px(recipe, bank))
    first = make_shot(crop, CENTRE, recipe, bank, np.random.default_rng(4))
    again = make_shot(crop, CENTRE, recipe, bank, np.random.default_rng(4))
    other = make_shot(crop, CENTRE, recipe, bank, np.random.default_rng(5))
    assert torch.equal(first.sample.stacked(LAYOUT), again.sample.stacked(LAYOUT))
    assert not torch.equal(first.sample.stacked(LAYOUT), other.sample.stacked(LAYOUT))


def test_drawn_exposures_stay_in_their_ranges(recipe, bank):
    rng = np.random.default_rng(0)
    drawn = [draw_exposure(rng, recipe, bank) for _ in range(400)]
    data = recipe.data
    assert all(data.iso_min <= e.iso <= data.iso_max for e in drawn)
    assert all(2**data.exposure_min_ev <= e.factor <= 2**data.exposure_max_ev for e in drawn)
    assert {e.copy for e in drawn} == set(range(bank.training_copies))
    deep = replace(bank, copies=np.repeat(bank.copies, 3, axis=0), depths=3)
    drawn_deep = {draw_exposure(rng, recipe, deep).copy for _ in range(100)}
    assert drawn_deep == set(range(3 * bank.training_copies)), "every depth of every copy"
    heights = [np.hypot(e.x_mm, e.y_mm) for e in drawn]
    assert max(heights) <= corner_height_mm(recipe)
    at_border = np.mean([any(e.borders) for e in drawn])
    assert 0.1 < at_border <= data.border_share + 0.05


def test_a_bank_that_finds_the_distance_is_told_it_with_an_error(recipe, bank):
    apart = np.stack([bank.frozen, np.roll(bank.frozen, 1, axis=-1)])
    deep = replace(bank, copies=np.repeat(bank.copies, 2, axis=0), depths=2, frozen_depths=apart)
    finds = replace(
        recipe,
        wiener=recipe.wiener.model_copy(update={"depth": "estimated"}),
        lens=replace(recipe.lens, depths_mm=(500.0, 1000.0)),
        data=replace(recipe.data, depth_error=0.2),
    )
    drawn = [draw_exposure(np.random.default_rng(i), finds, deep) for i in range(400)]
    inside = [e.filter_depth - e.copy % 2 for e in drawn if 0 < e.filter_depth < 1]
    assert len(inside) > 150, "half of the errors lead beyond the depths, and end there"
    # depths lie 1 / m apart, so numbers of depths are errors in 1 / m
    assert np.std([*inside, *(-np.array(inside))]) == pytest.approx(0.2, rel=0.15)
    between = deep.frozen_kernels(0.0, 0.2, 0.25)
    near, far = (deep.frozen_kernels(0.0, 0.2, number) for number in (0, 1))
    torch.testing.assert_close(between, 0.75 * near + 0.25 * far, atol=1e-6, rtol=0)


def test_the_filter_knows_the_depth_of_some_samples(recipe, bank):
    wide = np.roll(bank.frozen, 1, axis=-1) / 2 + np.roll(bank.frozen, -1, axis=-1) / 2
    apart = np.stack([bank.frozen, wide])
    deep = replace(bank, copies=np.repeat(bank.copies, 2, axis=0), depths=2, frozen_depths=apart)
    some = replace(
        recipe,
        lens=replace(recipe.lens, depths_mm=(500.0, 900.0)),
        data=replace(recipe.data, known_depth_share=0.25),
    )
    drawn = [draw_exposure(np.random.default_rng(i), some, deep) for i in range(400)]
    assert 70 < sum(e.filter_depth is not None for e in drawn) < 130
    assert all(e.filter_depth in (None, e.copy % 2) for e in drawn), (
        "exactly, where no error is asked for"
    )
    unaware = [draw_exposure(np.random.default_rng(i), recipe, deep) for i in range(400)]
    assert [replace(e, filter_depth=None) for e in drawn] == unaware, "the rest is drawn as ever"
    side = scene_side_px(some, deep)
    crop = np.random.default_rng(1).random((3, side, side), dtype=np.float32)
    planes = {
        (depth, known): make_shot(
            crop,
            replace(drawn[0], copy=depth, filter_depth=depth if known else None),
            some,
            deep,
            np.random.default_rng(2),
        ).sample.stacked(LAYOUT)
        for depth in (0, 1)
        for known in (False, True)
    }
    assert torch.equal(planes[0, True], planes[0, False]), "the mean is that of depth 0 here"
    assert torch.equal(planes[1, True][:3], planes[1, False][:3]), "one capture"
    assert not torch.equal(planes[1, True][3:], planes[1, False][3:]), "another filter"


def test_depths_are_drawn_as_often_as_their_shares_say(recipe, bank):
    rng = np.random.default_rng(0)
    deep = replace(bank, copies=np.repeat(bank.copies, 3, axis=0), depths=3)
    uneven = replace(
        recipe,
        lens=replace(recipe.lens, depths_mm=(500.0, 700.0, 900.0)),
        data=replace(recipe.data, depth_shares=(2.0, 1.0, 1.0)),
    )
    drawn = np.array([draw_exposure(rng, uneven, deep).copy for _ in range(2000)])
    shares = np.bincount(drawn % 3, minlength=3) / drawn.size
    np.testing.assert_allclose(shares, (0.5, 0.25, 0.25), atol=0.04)
    assert set(drawn.tolist()) == set(range(deep.training_copies))


def spot_sample(recipe, bank, **changes):
    """Photograph one point of light in the dark, without noise to speak of."""
    crop = grey(recipe, bank, 0.0)
    middle = crop.shape[1] // 2
    crop[:, middle, middle] = 20.0
    exposure = replace(CENTRE, iso=1e-3, **changes)
    shot = make_shot(crop, exposure, recipe, bank, np.random.default_rng(0))
    green = unstabilise(shot.sample.inputs["capture"][None], *noise_of(shot), scale=recipe.scale)[
        0, 1
    ]
    return green.numpy().astype(np.float64)


def noise_of(shot):
    return torch.tensor(shot.noise.shot), torch.tensor(shot.noise.read_variance)


def spread(spot):
    """Give the covariance (yy, xx, xy) of a spot, as light on the sensor."""
    light = np.clip(spot, 0, None) / np.clip(spot, 0, None).sum()
    y, x = np.indices(spot.shape)
    y = y - (light * y).sum()
    x = x - (light * x).sum()
    return [(light * a * b).sum() for a, b in ((y, y), (x, x), (x, y))]


@pytest.fixture
def long_bank():
    """A lens whose spot is three times as long down the rows as across."""
    offsets = np.arange(-12, 13)
    kernel = np.exp(-0.5 * ((offsets[:, None] / 3.0) ** 2 + (offsets[None, :] / 1.0) ** 2))
    kernels = np.broadcast_to(kernel / kernel.sum(), (2, 2, 3, 25, 25)).astype(np.float32)
    return PsfBank(
        copies=kernels.copy(),
        copy_heights_mm=np.array([0.0, 2.0]),
        frozen=kernels[0].copy(),
        frozen_heights_mm=np.array([0.0, 2.0]),
        relative_illumination=np.array([1.0, 1.0]),
    )


def test_drift_scales_the_spot_and_keeps_its_light(recipe, long_bank):
    still = spot_sample(recipe, long_bank)
    grown = spot_sample(recipe, long_bank, drift=(1.25, 0.0))
    assert grown.sum() == pytest.approx(still.sum(), rel=0.02)
    assert spread(grown)[0] / spread(still)[0] == pytest.approx(1.25**2, rel=0.04)


def test_drift_turns_the_spot(recipe, long_bank):
    upright = spread(spot_sample(recipe, long_bank))
    lying = spread(spot_sample(recipe, long_bank, drift=(1.0, np.pi / 2)))
    assert upright[0] > 3 * upright[1]
    assert lying[1] == pytest.approx(upright[0], rel=0.05)
    assert lying[0] == pytest.approx(upright[1], rel=0.05)


def test_as_many_samples_drift_as_the_recipe_says(recipe, bank):
    data = replace(recipe.data, drift_share=0.3, drift_scale=0.05, drift_turn_deg=2.0)
    rng = np.random.default_rng(0)
    drifts = np.array(
        [draw_exposure(rng, replace(recipe, data=data), bank).drift for _ in range(500)]
    )
    moved = (drifts != (1.0, 0.0)).any(axis=1)
    assert 0.24 < moved.mean() < 0.36
    assert 0.04 < np.abs(drifts[:, 0] - 1).max() <= 0.05
    assert 1.5 < np.rad2deg(np.abs(drifts[:, 1]).max()) <= 2.0
    assert all(draw_exposure(rng, recipe, bank).drift == (1.0, 0.0) for _ in range(20))


def test_crop_of_another_size_is_refused(recipe, bank):
    with pytest.raises(ContractError, match="a crop must be"):
        make_shot(np.zeros((3, 8, 8), np.float32), CENTRE, recipe, bank, np.random.default_rng(0))


# ------------------------------------------------------------------------------- planes


def test_without_a_mosaic_every_pixel_has_the_noise_of_the_sensor(planes_recipe, sharp_bank):
    rng = np.random.default_rng(3)
    shot = make_shot(grey(planes_recipe, sharp_bank, 0.3), CENTRE, planes_recipe, sharp_bank, rng)
    noise = (shot.sample.inputs["capture"] - shot.sample.target).numpy()
    assert noise.std(axis=(1, 2)) == pytest.approx(0.5 / planes_recipe.scale, rel=0.06)


def test_without_blur_and_noise_planes_are_their_target_at_any_detail(planes_recipe, sharp_bank):
    side = scene_side_px(planes_recipe, sharp_bank)
    crop = np.random.default_rng(1).uniform(0.1, 0.8, (3, side, side)).astype(np.float32)
    quiet = replace(planes_recipe, sensor=with_wells(planes_recipe.sensor, 1e5))
    for borders in ((False,) * 4, (True, False, False, True)):
        exposure = replace(CENTRE, borders=borders)
        developed = photograph(crop, exposure, quiet, sharp_bank, np.random.default_rng(0))
        margin = planes_recipe.data.margin_px
        middle = developed.planes[..., margin:-margin, margin:-margin]
        assert float((middle - developed.true).abs().max()) < 2e-3
        assert developed.circumstances.red is None
        assert developed.circumstances.gains == (1.0, 1.0, 1.0)


def test_a_pixel_of_planes_is_unknown_where_one_colour_clipped(planes_recipe, sharp_bank):
    scene = grey(planes_recipe, sharp_bank, 0.2)
    scene[1, 50:54, 50:54] = 5.0
    developed = photograph(scene, CENTRE, planes_recipe, sharp_bank, np.random.default_rng(0))
    assert developed.unknown.shape[1] == 1
    assert int(developed.unknown.sum()) == 16


def test_samples_of_planes_are_drawn_in_any_light(planes_recipe, bank):
    data = replace(planes_recipe.data, light_share=1.0)
    recipe = replace(planes_recipe, data=data)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        exposure = draw_exposure(rng, recipe, bank)
        scene = grey(recipe, bank, 0.3)
        shot = make_shot(scene, exposure, recipe, bank, rng)
        assert all(torch.isfinite(plane).all() for plane in shot.sample.inputs.values())
