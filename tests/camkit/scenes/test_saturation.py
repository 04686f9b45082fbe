"""The exposure that saturates a share is exact, and where there is none, that is said."""

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.hdr.night import night_scene
from camkit.scenes.saturation import (
    fill_of,
    saturating_exposure,
    saturation_at,
    with_exposure,
)

GREY = np.eye(3)
ONES = (1.0, 1.0, 1.0)
MATRIX = np.array([[1.2, -0.3, 0.1], [-0.2, 1.4, -0.2], [0.05, -0.45, 1.4]])
GAINS = (2.1, 1.0, 1.6)


def shares(seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).random((3, 40, 50), dtype=np.float32) ** 4 * 30


def slow_fraction(scene: FloatArray, exposure: float) -> float:
    """Count pixel by pixel, as a sensor would clip."""
    count = 0
    for pixel in scene.reshape(3, -1).T.astype(np.float64):
        raw = MATRIX @ (pixel * exposure) / np.array(GAINS)
        count += bool((raw > 1).any())
    return count / scene[0].size


@pytest.mark.parametrize("share", [0.0005, 0.015, 0.1, 0.5, 0.999])
def test_exactly_the_share_saturates_and_a_little_less_light_saturates_less(share: float) -> None:
    scene = shares()
    found = saturating_exposure(scene, MATRIX, GAINS, share)
    wanted = round(share * 2000) / 2000
    assert found.saturated_fraction == wanted
    assert slow_fraction(scene, found.exposure) == wanted
    assert slow_fraction(scene, found.exposure * (1 - 3e-3)) < wanted
    assert found.peak == pytest.approx(min(256, found.exposure * scene.max()))


def test_a_colour_clips_at_its_gain_and_not_at_white() -> None:
    scene = np.zeros((3, 10, 10), dtype=np.float32)
    scene[0, 0, 0], scene[1, 5, 5] = 2.0, 1.1
    fill = fill_of(scene, GREY, (2.1, 1.0, 1.6))
    assert fill[0, 0] == pytest.approx(2 / 2.1)
    assert fill[5, 5] == pytest.approx(1.1)
    found = saturation_at(1.0, scene, GREY, (2.1, 1.0, 1.6))
    assert found.saturated_fraction == 0.01
    assert found.peak == 2.0


def test_the_exposed_scene_ends_at_the_ceiling() -> None:
    scene = shares()
    found = saturating_exposure(scene, GREY, ONES, 0.9, ceiling=16.0)
    exposed = with_exposure(scene, found.exposure, ceiling=16.0)
    assert found.peak == exposed.max() == 16
    assert (exposed > 1).any(axis=0).mean() == 0.9
    assert scene.max() < 31, "the scene itself stays"


@pytest.mark.parametrize("share", [0.003, 0.015, 0.06])
def test_night_scenes_reach_the_shares_that_are_asked_for(share: float) -> None:
    for seed in range(3):
        scene = night_scene(seed, 120, 160)
        found = saturating_exposure(scene, MATRIX, GAINS, share)
        assert found.saturated_fraction == pytest.approx(share, rel=0.02)


def test_few_lights_before_black_saturate_alone() -> None:
    scene = np.zeros((3, 20, 50), dtype=np.float32)
    scene[:, 3, 4:14] = np.arange(1, 11)
    found = saturating_exposure(scene, GREY, ONES, 0.01)
    assert found.saturated_fraction == 0.01
    assert found.exposure == pytest.approx(1, rel=2e-3)


def test_lights_that_are_alike_saturate_together_where_that_is_near_enough() -> None:
    scene = np.zeros((3, 100, 100), dtype=np.float32)
    scene[:, 0, :98] = 5
    scene[:, 1, :98] = 2
    assert saturating_exposure(scene, GREY, ONES, 0.01).saturated_fraction == 0.0098
    scene[:, 0, 98:], scene[:, 1, 0] = 5, 5
    assert saturating_exposure(scene, GREY, ONES, 0.0098).saturated_fraction == 0.0101
    scene[:, 1, :98] = 5
    with pytest.raises(ContractError, match=r"1\.980% of its pixels are alike"):
        saturating_exposure(scene, GREY, ONES, 0.015)


def test_the_lights_just_brighter_saturate_where_those_alike_are_too_many() -> None:
    scene = np.full((3, 100, 100), 0.5, dtype=np.float32)
    scene[:, 0, :96] = np.linspace(1, 2, 96)
    found = saturating_exposure(scene, GREY, ONES, 0.01)
    assert found.saturated_fraction == 0.0096
    assert found.exposure == pytest.approx(1, rel=2e-3)


@pytest.mark.parametrize(
    ("scene", "share", "ceiling", "said"),
    [
        (np.full((3, 30, 30), 0.4, np.float32), 0.015, 256.0, "no exposure saturates 1.500%"),
        (np.zeros((3, 30, 30), np.float32), 0.015, 256.0, "no exposure saturates 1.500%"),
        (np.ones((3, 5, 5), np.float32), 0.01, 256.0, "less than one"),
        (np.ones((3, 0, 5), np.float32), 0.01, 256.0, "hold a pixel"),
        (np.ones((5, 5), np.float32), 0.01, 256.0, "must be"),
        (shares(), 0.0, 256.0, "between 0 and 1; got 0"),
        (shares(), 1.0, 256.0, "between 0 and 1; got 1"),
        (shares(), float("nan"), 256.0, "between 0 and 1; got nan"),
        (shares(), 0.015, 2.0, "ceiling must lie above 2.1"),
        (shares(), 0.015, float("inf"), "ceiling must lie above 2.1"),
    ],
)
def test_what_cannot_be_saturated_is_refused_in_one_line(
    scene: FloatArray, share: float, ceiling: float, said: str
) -> None:
    with pytest.raises(ContractError, match=said) as refused:
        saturating_exposure(scene, MATRIX, GAINS, share, ceiling=ceiling)
    assert "\n" not in str(refused.value)
