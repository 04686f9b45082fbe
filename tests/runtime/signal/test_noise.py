import time

import numpy as np
import pytest
import scipy.ndimage
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.signal.noise import (
    REPAIR_MARGIN_PX,
    fallback_noise,
    measure_noise,
    repair_mosaic,
    repair_planes,
)


def smooth_scene(h, w, seed=0):
    rng = np.random.default_rng(seed)
    scene = scipy.ndimage.gaussian_filter(rng.random((h, w)), 8)
    scene = (scene - scene.min()) / np.ptp(scene)
    return (0.03 + 0.85 * scene).astype(np.float32)


def noisy(scene, iso, seed=1):
    shot = iso / 100 / 45000
    sigma = np.sqrt(shot * scene + (3 * shot) ** 2)
    return scene + sigma * np.random.default_rng(seed).standard_normal(scene.shape), shot


def capture_of(linear, cfa="RGGB"):
    samples = np.clip(np.round(linear * 3839 + 256), 0, 4095).astype(np.uint16)
    black = np.full((2, 2) if cfa else (3,), 256, dtype=np.float32)
    return Capture(samples=samples, cfa=cfa, black_level=black, white_level=4095.0)


@pytest.mark.parametrize("iso", [100, 800, 6400])
def test_measured_noise_is_that_of_the_simulation(iso):
    linear, shot = noisy(smooth_scene(512, 768), iso)
    noise = measure_noise(capture_of(linear))
    for level in (0.1, 0.3, 0.7):
        measured = noise.shot[1] * level + noise.read_variance[1]
        expected = shot * level + (3 * shot) ** 2
        assert 0.8 < measured / expected < 1.25


@pytest.mark.parametrize("level", [0.0, 0.05, 0.4])
@pytest.mark.parametrize("read_e", [1.0, 10.0])
def test_one_level_gives_the_noise_of_that_level_and_a_sensor_that_exists(level, read_e):
    """A wall or a dark frame shows a sum: its shares are those of a usual sensor, never chance."""
    shot, worst = 2e-4, (3 / 3839) ** 2
    for seed in range(12):
        rng = np.random.default_rng(seed)
        electrons = rng.poisson(level / shot, (480, 640)) + read_e * rng.standard_normal((480, 640))
        noise = measure_noise(capture_of(shot * electrons))
        expected = shot * level + (read_e * shot) ** 2 + worst / 108
        assert 0.9 < (noise.shot[1] * level + noise.read_variance[1]) / expected < 1.1
        assert noise.read_variance[1] ** 0.5 / noise.shot[1] < 30
        assert 0.05 * shot < noise.shot[1] < 20 * shot


@pytest.mark.parametrize("sigma", [1e-3, 3e-3, 13e-3])
def test_chance_among_the_few_blocks_of_a_small_dark_frame_is_no_slope(sigma):
    rng = np.random.default_rng(5)
    noises = [measure_noise(capture_of(sigma * rng.standard_normal((192, 192)))) for _ in range(20)]
    reads_e = [noise.read_variance[1] ** 0.5 / noise.shot[1] for noise in noises]
    assert 2 < np.median(reads_e) < 5, "usual read noise, where nothing tells it"
    assert min(reads_e) > 0.5


@pytest.mark.parametrize("read_e", [0.5, 15.0, 40.0])
def test_read_noise_is_told_from_shot_noise_where_the_levels_differ(read_e):
    shot, ratios = 2e-4, []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        scene = smooth_scene(512, 768, seed)
        electrons = rng.poisson(scene / shot) + read_e * rng.standard_normal(scene.shape)
        noise = measure_noise(capture_of(shot * electrons))
        truth = shot * 0.1 + (read_e * shot) ** 2
        ratios.append((noise.shot[1] * 0.1 + noise.read_variance[1]) / truth)
    assert 0.7 < np.median(ratios) < 1.3


def test_noise_of_planes_is_measured_too():
    linear, shot = noisy(np.stack([smooth_scene(256, 384, s) for s in range(3)]), 800)
    noise = measure_noise(capture_of(linear, cfa=None))
    assert 0.75 < noise.shot[0] / shot < 1.25


@pytest.mark.parametrize("channels", [1, 2, 6])
def test_noise_of_any_number_of_planes_is_one_line_for_all(channels):
    scenes = np.stack([smooth_scene(256, 384, s) for s in range(channels)])
    linear, shot = noisy(scenes, 800)
    samples = np.clip(np.round(linear * 3839 + 256), 0, 4095).astype(np.uint16)
    black = np.full(channels, 256, dtype=np.float32)
    capture = Capture(samples=samples, cfa=None, black_level=black, white_level=4095.0)
    noise = measure_noise(capture)
    assert len(noise.shot) == len(noise.read_variance) == channels
    assert len(set(noise.shot)) == 1
    assert 0.75 < noise.shot[0] / shot < 1.25


def test_a_clipped_half_does_not_bias_the_measurement():
    linear, shot = noisy(smooth_scene(512, 768), 800)
    linear[:, 384:] = 1.2
    assert 0.75 < measure_noise(capture_of(linear)).shot[0] / shot < 1.25


def test_a_picture_too_small_to_measure_gets_the_stated_default():
    assert measure_noise(capture_of(np.full((16, 16), 0.5))) == fallback_noise()
    five = Capture(
        samples=np.full((5, 16, 16), 0.5, np.float32),
        cfa=None,
        black_level=np.zeros(5, np.float32),
        white_level=1.0,
    )
    assert measure_noise(five) == fallback_noise(5)


def test_invalid_samples_are_replaced_by_their_own_colour():
    mosaic = np.tile(np.array([[0.1, 0.5], [0.6, 0.9]], dtype=np.float32), (10, 10))
    broken = mosaic.copy()
    for row, col, value in ((4, 4, np.nan), (7, 5, np.inf), (0, 0, -np.inf), (19, 19, np.nan)):
        broken[row, col] = value
    repaired, mask = repair_mosaic(broken)
    np.testing.assert_array_equal(repaired, mosaic)
    assert mask.sum() == 4


def test_stuck_and_dead_samples_are_found_in_noise():
    linear, _ = noisy(smooth_scene(300, 300) * 0.3 + 0.2, 100)
    mosaic = linear.astype(np.float32)
    rng = np.random.default_rng(2)
    rows, cols = rng.integers(0, 300, (2, 60))
    broken = mosaic.copy()
    broken[rows[:30], cols[:30]] = 1.0
    broken[rows[30:], cols[30:]] = 0.0
    repaired, mask = repair_mosaic(broken)
    assert mask[rows, cols].mean() > 0.9
    assert mask.sum() <= 60
    assert np.abs(repaired - mosaic)[mask].max() < 0.1


@pytest.mark.parametrize("fwhm_px", [2.0, 3.0, 5.0])
def test_stars_blurred_by_a_lens_are_kept(fwhm_px):
    stars = np.zeros((200, 200))
    stars[np.random.default_rng(3).integers(5, 195, (2, 60)).tolist()] = 1
    light = scipy.ndimage.gaussian_filter(stars, fwhm_px / 2.355)
    linear, _ = noisy(0.01 + 0.9 * light / light.max(), 100)
    linear *= np.tile([[0.45, 1], [1, 0.65]], (100, 100))
    assert not repair_mosaic(linear.astype(np.float32))[1].any()


def test_a_sound_mosaic_comes_back_as_it_is():
    mosaic = noisy(smooth_scene(64, 64), 1600)[0].astype(np.float32)
    repaired, mask = repair_mosaic(mosaic)
    assert repaired is mosaic
    assert not mask.any()


def test_bands_with_margin_are_repaired_as_the_whole():
    mosaic = noisy(smooth_scene(90, 50), 100)[0].astype(np.float32)
    rng = np.random.default_rng(4)
    mosaic.flat[rng.choice(mosaic.size, 60, replace=False)] = np.nan
    mosaic.flat[rng.choice(mosaic.size, 20, replace=False)] = 2.0
    whole, mask = repair_mosaic(mosaic)
    for top in range(0, 90, 30):
        low, high = max(top - REPAIR_MARGIN_PX, 0), min(top + 30 + REPAIR_MARGIN_PX, 90)
        band, band_mask = repair_mosaic(mosaic[low:high])
        np.testing.assert_array_equal(band[top - low :][:30], whole[top : top + 30])
        np.testing.assert_array_equal(band_mask[top - low :][:30], mask[top : top + 30])


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32))
@settings(deadline=None, max_examples=40)
def test_no_size_and_no_damage_leaves_an_invalid_sample(h, w, seed):
    rng = np.random.default_rng(seed)
    mosaic = rng.random((h, w), dtype=np.float32)
    mosaic[rng.random((h, w)) < 0.4] = np.nan
    repaired, mask = repair_mosaic(mosaic)
    assert np.isfinite(repaired).all()
    np.testing.assert_array_equal(repaired[~mask], mosaic[~mask])


def test_planes_are_repaired_one_by_one():
    planes = np.full((3, 9, 9), 0.3, dtype=np.float32)
    planes[1, 4, 4], planes[2, 0, 0] = np.nan, 5.0
    repaired, mask = repair_planes(planes)
    np.testing.assert_array_equal(repaired, np.float32(0.3))
    assert mask.sum() == 2
    assert mask[1, 4, 4]
    assert mask[2, 0, 0]
    for channels in (1, 5):
        many = np.repeat(planes[1][None], channels, axis=0)
        many[-1, 2, 7] = np.inf
        sound, broken = repair_planes(many)
        np.testing.assert_array_equal(sound, np.float32(0.3))
        assert broken.sum() == channels + 1


def test_a_mosaic_must_be_flat():
    with pytest.raises(ContractError, match="mosaic"):
        repair_mosaic(np.zeros((3, 4, 4), dtype=np.float32))


def test_repair_of_six_megapixels_in_bands_is_quick():
    band = np.random.default_rng(0).random((132, 6000), dtype=np.float32)
    start = time.process_time()
    for _ in range(8):
        repair_mosaic(band)
    assert time.process_time() - start < 1.0


def test_of_pure_noise_about_one_sample_in_a_hundred_thousand_is_replaced():
    rng = np.random.default_rng(5)
    flat = (0.3 + 0.02 * rng.standard_normal((1000, 1000))).astype(np.float32)
    assert repair_mosaic(flat)[1].mean() < 3e-5


def test_a_stuck_sample_in_soft_texture_is_found():
    y, x = np.mgrid[:64, :64]
    texture = (0.4 + 0.1 * np.sin(x / 6) * np.cos(y / 7)).astype(np.float32)
    for value in (0.0, 1.0):
        spoiled = texture.copy()
        spoiled[30, 31] = value
        repaired, mask = repair_mosaic(spoiled)
        assert np.argwhere(mask).tolist() == [[30, 31]]
        assert abs(repaired[30, 31] - texture[30, 31]) < 0.03
