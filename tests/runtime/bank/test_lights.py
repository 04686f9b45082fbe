"""Clipped lights are explained where they are, in windows or whole, and nowhere else."""

import numpy as np
import pytest

from camkit.bundle.stages import Wiener
from camkit.runtime.bank.blocks import Block, taper_edges, to_otf
from camkit.runtime.bank.lights import (
    RULES,
    choose_windows,
    explain_lights,
    light_share,
    nearness,
)
from camkit.runtime.bank.richardson_lucy import background_of, richardson_lucy, spread_clipped
from camkit.runtime.bank.spectrum import apply_transfer
from camkit.runtime.bank.wiener import wiener_filter
from tests.psf_factory import ISO_100, blur_periodic, gaussian_kernel, psnr_db, texture, with_noise

SIDE, KERNEL_PX, REACH_PX = 384, 21, 16
SETTINGS = Wiener(
    block_px=SIDE,
    overlap_px=160,
    prior_scale=3e-4,
    prior_exponent=2.5,
    clip_iterations=6,
    clip_reach_px=REACH_PX,
)
RULE = RULES[SETTINGS.clip_windows]


def clipped_block(places: list[tuple[int, int]]) -> tuple[Block, np.ndarray]:
    """Give a block with lights, and the scene."""
    scene = texture(SIDE, SIDE, seed=3) * np.float32(0.5)
    for row, column in places:
        scene[:, row : row + 4, column : column + 4] = 30.0
    kernel = gaussian_kernel(2.5, radius_px=KERNEL_PX // 2)
    planes = with_noise(blur_periodic(scene, kernel), ISO_100, np.random.default_rng(0))
    unknown = (planes >= 1).any(axis=0, keepdims=True)
    otf = to_otf(kernel, SIDE)
    return Block(
        samples=taper_edges(np.minimum(planes, 1), otf, 40), otf=otf, unknown=unknown
    ), scene


def test_nearness_falls_from_one_to_nothing_by_distance() -> None:
    mask = np.zeros((2, 64, 64), dtype=bool)
    mask[0, 32, 32] = True
    near = nearness(mask, REACH_PX)
    assert near[0, 32, 32] == near[0, 32, 32 + REACH_PX // 2] == 1
    assert 0 < near[0, 32, 32 + REACH_PX - 2] < 0.2
    assert near[0, 32, 32 + REACH_PX] == 0
    np.testing.assert_array_equal(near[0], near[0].T)
    assert not near[1].any()


@pytest.mark.parametrize(
    ("cells", "kernel_px", "size"),
    [
        ([(10, 10)], 21, 96),
        ([(10, 10)], 210, 128),
        ([(10, 10)], 300, 192),
        ([(10, 10)], 386, None),
        ([(10, 10)], None, None),
        ([(i, j) for i in range(0, 384, 8) for j in range(0, 384, 8)], 21, None),
    ],
)
def test_windows_are_chosen_by_kernel_and_work(
    cells: list[tuple[int, int]], kernel_px: int | None, size: int | None
) -> None:
    mask = np.zeros((SIDE, SIDE), dtype=bool)
    for cell in cells:
        mask[cell] = True
    chosen = choose_windows(mask, SIDE, kernel_px, RULE)
    if size is None:
        assert chosen is None
        assert light_share(mask, SIDE, kernel_px, SETTINGS, step_px=1) == 1
    else:
        assert chosen is not None
        assert chosen[0] == size
        assert chosen[1] == ((10, 10),)
        share = light_share(mask, SIDE, kernel_px, SETTINGS, step_px=1)
        assert share == pytest.approx((size**2 + RULE.extra) / SIDE**2)


def test_windows_explain_what_the_whole_block_explains() -> None:
    block, _ = clipped_block([(60, 70), (62, 100), (250, 300)])
    assert block.unknown is not None
    unknown, background = spread_clipped(block.unknown), background_of(ISO_100)
    whole, left = explain_lights(block, unknown, background, SETTINGS, None)
    windows, left_there = explain_lights(block, unknown, background, SETTINGS, KERNEL_PX)
    assert whole.max() > 1.2
    assert np.square(windows - whole).mean() < 0.01 * np.square(whole).mean()
    assert windows.sum() == pytest.approx(whole.sum(), rel=0.05)
    # a window does not see the light beyond it
    assert (left_there < 3 * left).all()
    assert (left_there > left / 3).all()
    assert block.unknown is not None
    far = nearness(block.unknown, REACH_PX)[0] == 0
    assert not windows[:, far].any()


def test_without_a_reach_the_whole_block_is_explained_as_bundles_of_2_0_mean_it() -> None:
    block, _ = clipped_block([(60, 70)])
    old = SETTINGS.model_copy(update={"clip_reach_px": None})
    assert block.unknown is not None
    clipped = spread_clipped(block.unknown)
    found, _ = explain_lights(block, clipped, background_of(ISO_100), old, KERNEL_PX)
    whole = richardson_lucy(block.samples, block.otf, background_of(ISO_100), 6, clipped)
    np.testing.assert_array_equal(found, whole)


def test_a_round_of_the_second_power_goes_about_twice_as_far() -> None:
    """As likely (Poisson) after three rounds as after five to seven plain ones."""
    block, _ = clipped_block([(60, 70)])
    background = background_of(ISO_100)

    def misfit(rounds: int, power: float) -> float:
        found = richardson_lucy(block.samples, block.otf, background, rounds, power=power)
        expected = np.maximum(apply_transfer(found, block.otf), 0) + background
        measured = np.maximum(block.samples + background, 1e-6)
        return float((expected - measured * np.log(expected)).sum(dtype=np.float64))

    assert misfit(7, 1.0) < misfit(3, 2.0) < misfit(4, 1.0)


def test_a_kernel_twice_as_wide_as_a_window_still_fits_it() -> None:
    mask = np.zeros((SIDE, SIDE), dtype=bool)
    mask[60, 70] = True
    half = SIDE // 2
    assert choose_windows(mask, SIDE, 2 * half, RULE) is not None
    assert choose_windows(mask, SIDE, 2 * half + 2, RULE) is None


def test_away_from_lights_a_block_is_what_the_filter_alone_makes_of_it() -> None:
    """Once the whole block went through the rounds, and lost detail for a light in a corner."""
    block, scene = clipped_block([(60, 70)])
    dark = Block(samples=block.samples, otf=block.otf)
    explained = wiener_filter(SETTINGS, ISO_100, KERNEL_PX)(block)
    plain = wiener_filter(SETTINGS, ISO_100, KERNEL_PX)(dark)
    inner = np.s_[:, 48:-48, 48:-48]
    far = np.ones((SIDE, SIDE), dtype=bool)
    far[:140, :150] = False
    truth = scene[inner][:, far[48:-48, 48:-48]]
    near_truth = psnr_db(explained[inner][:, far[48:-48, 48:-48]], truth)
    assert near_truth > psnr_db(plain[inner][:, far[48:-48, 48:-48]], truth) - 0.5
    around = np.s_[:, 50:90, 60:100]
    error, plain_error = (np.abs(x[around] - scene[around]).mean() for x in (explained, plain))
    assert error < 0.95 * plain_error


def test_a_light_takes_one_window_wherever_it_lies() -> None:
    """Windows lay on a grid once: a light on its lines took four, or the whole block."""
    for place in (64, 128, 190):
        mask = np.zeros((SIDE, SIDE), dtype=bool)
        mask[place - 2 : place + 2, place - 2 : place + 2] = True
        assert choose_windows(mask, SIDE, 210, RULE) == (128, ((place - 2, place - 2),))


def test_cells_cover_every_clipped_sample_once() -> None:
    mask = np.random.default_rng(0).random((SIDE, SIDE)) < 1e-5
    chosen = choose_windows(mask, SIDE, KERNEL_PX, RULE)
    assert chosen is not None
    size, cells = chosen
    core = size - 2 * RULE.margin_px
    for row, column in cells:
        assert mask[row : row + core, column : column + core].any()
        mask[row : row + core, column : column + core] = False
    assert not mask.any()


def test_windows_of_older_bundles_hold_whole_kernels_and_give_their_bits() -> None:
    """A window of the older rule is wider than the kernel, and explains as the whole block does."""
    block, _ = clipped_block([(190, 190)])
    older = SETTINGS.model_copy(update={"clip_windows": "whole_kernel"})
    mask = np.asarray(block.unknown.any(axis=0))
    wide = 100
    assert choose_windows(mask, SIDE, wide, RULES["whole_kernel"])[0] >= 0.95 * wide
    assert choose_windows(mask, SIDE, wide, RULE)[0] >= 0.5 * wide
    spread = spread_clipped(block.unknown)
    background = background_of(ISO_100)
    found, _ = explain_lights(block, spread, background, older, KERNEL_PX)
    whole = SETTINGS.model_copy(update={"clip_reach_px": REACH_PX})
    in_block, _ = explain_lights(block, spread, background, whole, None)
    np.testing.assert_allclose(found, in_block, atol=0.02 * float(in_block.max()))
