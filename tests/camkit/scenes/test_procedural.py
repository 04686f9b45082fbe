from itertools import pairwise

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.scenes import procedural_scene


@pytest.fixture(scope="module")
def scene():
    return procedural_scene(5, 384, 512)


def test_same_seed_gives_the_same_scene(scene):
    assert np.array_equal(scene, procedural_scene(5, 384, 512))


def test_other_seed_gives_another_scene(scene):
    assert np.abs(scene - procedural_scene(6, 384, 512)).mean() > 0.02


def test_scene_is_planar_float32_of_the_asked_size(scene):
    assert scene.shape == (3, 384, 512)
    assert scene.dtype == np.float32
    assert scene.flags.c_contiguous


def test_scene_is_finite_and_not_negative(scene):
    assert np.isfinite(scene).all()
    assert scene.min() >= 0


def test_scenes_hold_light_above_white_and_deep_shadow():
    scenes = [procedural_scene(seed, 512, 512) for seed in range(3)]
    assert max(s.max() for s in scenes) > 2
    assert min(np.percentile(s, 5) for s in scenes) < 0.05


def test_scenes_have_the_spectrum_of_natural_images():
    """Power falls about as f^-2 between 1/64 and 1/4 cycles per pixel (Field 1987)."""
    slopes = []
    for seed in range(4):
        grey = np.sqrt(procedural_scene(seed, 256, 256).mean(axis=0))
        window = np.hanning(256)[:, None] * np.hanning(256)[None, :]
        power = np.abs(np.fft.fft2((grey - grey.mean()) * window)) ** 2
        radius = np.hypot(np.fft.fftfreq(256)[:, None], np.fft.fftfreq(256)[None, :])
        edges = np.geomspace(1 / 64, 1 / 4, 9)
        bands = [power[(radius >= a) & (radius < b)].mean() for a, b in pairwise(edges)]
        centres = np.sqrt(edges[1:] * edges[:-1])
        slopes.append(np.polyfit(np.log(centres), np.log(bands), 1)[0])
    assert -3.2 < np.mean(slopes) < -1.4


@pytest.mark.parametrize("size", [(1, 1), (1, 300), (17, 3), (600, 40)])
def test_any_size_works(size):
    scene = procedural_scene(1, *size)
    assert scene.shape == (3, *size)
    assert np.isfinite(scene).all()


@pytest.mark.parametrize(("seed", "height", "width"), [(-1, 4, 4), (0, 0, 4), (0, 4, -2)])
def test_impossible_requests_are_refused(seed, height, width):
    with pytest.raises(ContractError, match="positive size and a seed"):
        procedural_scene(seed, height, width)


@pytest.mark.parametrize(
    ("seed", "size", "means", "most"),
    [
        (5, (64, 96), (0.1322308, 0.1280601, 0.1375466), 1.110827),
        (7, (200, 300), (0.1946287, 0.1961309, 0.2044885), 50.81047),
    ],
)
def test_seeds_keep_their_scenes_from_version_to_version(seed, size, means, most):
    """Bundles, journals and reports name scenes by their seeds; bits may differ by processor."""
    scene = procedural_scene(seed, *size)
    np.testing.assert_allclose(scene.mean(axis=(1, 2)), means, rtol=1e-5)
    assert scene.max() == pytest.approx(most, rel=1e-5)
