"""Night scenes: dark surfaces, lamps up to 256 times white, as many as a seed wants."""

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.hdr.night import assembly, night_scene, places
from camkit.runtime.kinds.hdr.night.lamp import MOST_POWER

SIDE_PX = 160
SEEDS = range(36)


def lit(picture: FloatArray) -> np.ndarray:
    return (picture > 1).any(axis=0)


def light_shares(scenes: list[FloatArray]) -> np.ndarray:
    return np.array([lit(picture).mean() for picture in scenes])


@pytest.fixture(scope="module")
def scenes() -> list[FloatArray]:
    return [night_scene(seed, SIDE_PX, SIDE_PX) for seed in SEEDS]


def test_the_same_seed_gives_the_same_scene_and_another_does_not(scenes):
    assert np.array_equal(scenes[5], night_scene(5, SIDE_PX, SIDE_PX))
    assert np.abs(scenes[5] - scenes[6]).mean() > 0.01


def test_scenes_are_finite_planes_that_end_at_the_ceiling(scenes):
    for picture in scenes:
        assert (picture.shape, picture.dtype) == ((3, SIDE_PX, SIDE_PX), np.float32)
        assert picture.flags.c_contiguous
        assert np.isfinite(picture).all()
        assert picture.min() >= 0
        assert picture.max() <= MOST_POWER


def test_most_of_a_scene_is_dark(scenes):
    medians = np.array([np.median(picture.max(axis=0)) for picture in scenes])
    assert 0.02 < np.median(medians) < 0.1
    assert medians.max() < 0.4


def test_the_share_above_white_differs_by_two_powers_of_ten(scenes):
    shares = light_shares(scenes)
    assert shares.min() > 0.0004
    assert shares.max() < 0.15
    assert shares.max() > 30 * shares.min()


def test_lamps_are_of_every_power_between_white_and_the_ceiling(scenes):
    values = np.concatenate([picture.max(axis=0)[lit(picture)] for picture in scenes])
    parts, _ = np.histogram(values, [1, 2, 4, 8, 16, 32, 64, 128, MOST_POWER * 1.01])
    assert (parts > 0.003 * values.size).all()
    # few are near the ceiling
    assert parts[-1] < 0.1 * values.size
    assert max(picture.max() for picture in scenes) > 0.8 * MOST_POWER


def test_colours_clip_apart(scenes):
    apart = [((picture > 1).any(axis=0) & (picture < 1).any(axis=0)).sum() for picture in scenes]
    assert sum(apart) > 0.2 * sum(lit(picture).sum() for picture in scenes)


def test_a_large_scene_is_like_a_small_one_not_like_an_enlarged_one():
    """Share of light, darkness and the steps between neighbours do not depend on the size."""
    facts = []
    for side in (128, 320):
        found = [night_scene(seed, side, side) for seed in range(12)]
        edges = [np.abs(np.diff(lit(picture), axis=1)).mean() for picture in found]
        medians = [np.median(picture) for picture in found]
        facts.append([np.mean(light_shares(found)), np.mean(edges), np.mean(medians)])
    ratios = np.array(facts[1]) / facts[0]
    assert (ratios > 0.5).all(), ratios
    assert (ratios < 2).all(), ratios


@pytest.mark.parametrize("paint", places.PLACES)
def test_every_place_is_painted_at_any_size(paint, monkeypatch):
    monkeypatch.setattr(assembly, "PLACES", {paint: 1.0})
    for size in ((1, 1), (1, 200), (200, 1), (17, 3), (90, 140)):
        picture = night_scene(3, *size)
        assert picture.shape == (3, *size)
        assert np.isfinite(picture).all()
        assert picture.min() >= 0


@pytest.mark.parametrize("paint", places.PLACES)
def test_every_place_has_lamps_and_darkness(paint, monkeypatch):
    monkeypatch.setattr(assembly, "PLACES", {paint: 1.0})
    found = [night_scene(seed, SIDE_PX, SIDE_PX) for seed in range(3)]
    assert light_shares(found).mean() > 0.002
    assert np.mean([np.median(picture) for picture in found]) < 0.15


@pytest.mark.parametrize(("seed", "height", "width"), [(-1, 4, 4), (0, 0, 4), (0, 4, -2)])
def test_impossible_requests_are_refused(seed, height, width):
    with pytest.raises(ContractError, match="positive size and a seed"):
        night_scene(seed, height, width)


@pytest.mark.parametrize(
    ("seed", "means", "most"),
    [(1, (0.22581, 0.14907, 0.11581), 94.315), (7, (0.22779, 0.30096, 0.25961), 19.193)],
)
def test_seeds_keep_their_scenes_from_version_to_version(seed, means, most):
    """Tables and bundles name scenes by their seeds; bits may differ by processor."""
    picture = night_scene(seed, 96, 128)
    np.testing.assert_allclose(picture.mean(axis=(1, 2)), means, rtol=1e-3)
    assert picture.max() == pytest.approx(most, rel=1e-3)
