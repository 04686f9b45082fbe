"""Pixels that stand out alone are hot or damaged; what noise and light do is not counted."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.runtime.files.lone_pixels import MARGIN_PX, count_lone
from camkit.runtime.files.raw_checks import Levels
from camkit.runtime.files.raw_decode import LONE_NOTE_SHARE
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from camkit.scenes import procedural_scene

BLACK, WHITE = 256, 4095
LEVELS = Levels(black=np.full((2, 2), BLACK, dtype=np.float32), white=WHITE)


@pytest.fixture(scope="module")
def camera():
    return open_bundle(find_bundle("duet"))


def photographed(camera, iso, seed=7):
    """Photograph a scene of fine texture, text and clipped lights."""
    scene = procedural_scene(seed, 240, 320)
    options = SimulationOptions(iso=iso, seed=seed)
    return simulate(scene, camera.manifest.sensor, camera.psf, options).samples


@pytest.mark.parametrize("iso", [100, 1600, 6400])
def test_texture_highlights_and_noise_of_a_clean_capture_are_no_damage(camera, iso):
    clean = photographed(camera, iso)
    assert count_lone(clean, LEVELS, 2) < LONE_NOTE_SHARE * clean.size


@pytest.mark.parametrize("iso", [100, 6400])
def test_hot_and_dead_pixels_are_found_among_texture_and_noise(camera, iso):
    broken = photographed(camera, iso)
    rng = np.random.default_rng(5)
    places = rng.choice(236 * 316, 80, replace=False)
    rows, cols = places // 316 + MARGIN_PX, places % 316 + MARGIN_PX
    visible = broken[rows, cols] < WHITE // 2
    broken[rows[visible], cols[visible]] = WHITE
    found = count_lone(broken, LEVELS, 2)
    assert 0.6 * visible.sum() < found <= visible.sum()


def test_a_dead_pixel_in_a_bright_plain_counts_too():
    rng = np.random.default_rng(1)
    plain = rng.normal(2500, 20, (40, 60)).astype(np.uint16)
    assert count_lone(plain, LEVELS, 2) == 0
    plain[20, 30] = BLACK
    assert count_lone(plain, LEVELS, 2) == 1
    assert count_lone(plain, LEVELS, 1) == 1


def test_a_star_that_the_lens_spreads_over_the_colours_is_light():
    dark = np.full((20, 20), 300, np.uint16)
    star = dark.copy()
    star[10, 10] = 3000
    assert count_lone(star, LEVELS, 2) == 1
    star[9:12, 9:12] += 400
    assert count_lone(star, LEVELS, 2) == 0


def lone_one_by_one(samples, cell, step):
    """Count in a plane by the definition, pixel by pixel."""
    count = 0
    shifts = [(y, x) for y in (-cell, 0, cell) for x in (-cell, 0, cell) if y or x]
    for y in range(2, samples.shape[0] - 2):
        for x in range(2, samples.shape[1] - 2):
            ring = [int(samples[y + dy, x + dx]) for dy, dx in shifts]
            beyond = max(int(samples[y, x]) - max(ring), min(ring) - int(samples[y, x]))
            count += beyond > max(step, 2 * (max(ring) - min(ring)))
    return count


@settings(max_examples=15, deadline=None)
@given(
    height=st.integers(1, 75),
    width=st.integers(1, 12),
    dtype=st.sampled_from([np.uint8, np.uint16]),
)
def test_lone_pixels_of_a_plane_are_counted_as_defined(height, width, dtype):
    rng = np.random.default_rng(height * 100 + width)
    top = int(np.iinfo(dtype).max)
    samples = rng.integers(top // 3, top // 2, (height, width)).astype(dtype)
    broken = rng.random((height, width)) < 0.1
    samples[broken] = rng.choice([0, top], broken.sum())
    levels = Levels(black=np.zeros((2, 2), np.float32), white=float(top))
    assert count_lone(samples, levels, 1) == lone_one_by_one(samples, 1, round(0.1 * top))
