"""Empty pixels beside surfaces are believed no more often than is stated, in both orientations."""

from collections import Counter
from collections.abc import Iterable
from itertools import product

import numpy as np
import pytest
from scipy.stats import beta

from camkit.runtime.kinds.spad.pooling import FALSE_ALARMS
from camkit.runtime.kinds.spad.surroundings import least_gain
from camkit.runtime.kinds.spad.time_axis import Orientation
from tests.runtime.kinds.spad.empty_scenes import EMPTY, Light, Stage

PILE_UP = (0.0, 0.5, 1.0, 2.0)
"""Photons of a cycle, or of a gate at its brightest."""


def _sum(stage: Stage, lights: Iterable[Light], scenes: Iterable[str], times: int) -> Counter[str]:
    every = product(lights, scenes, range(times))
    return sum((stage.believed(scene, light) for light, scene, _ in every), start=Counter())


def _rate(found: Counter[str]) -> tuple[float, float, float]:
    """Return the rate of false alarms and its 95 % bounds (Clopper and Pearson)."""
    alarms, rest = found["alarms"], found["empty"] - found["alarms"]
    low = float(beta.ppf(0.025, alarms, rest + 1)) if alarms else 0.0
    return alarms / found["empty"], low, float(beta.ppf(0.975, alarms + 1, rest))


def _told(found: Counter[str]) -> str:
    rate, low, high = (f"{100 * value:.3f} %" for value in _rate(found))
    seen = found["seen"] / max(found["surface"], 1)
    return f"false {rate} ({low} to {high}) of {found['empty']}, surfaces seen {seen:.1%}"


@pytest.mark.parametrize("orientation", ["gate", "histogram"])
@pytest.mark.parametrize(
    ("width_ps", "light"),
    [
        (1000, Light(photons=100, ratio=1)),
        (600, Light(photons=300, ratio=5)),
        (200, Light(photons=30, ratio=1)),
        (1000, Light(photons=1000, ratio=0.3, lost=1.0)),
        (200, Light(photons=300, ratio=1, sky=5)),
    ],
)
def test_empty_pixels_beside_surfaces_keep_the_false_alarm_rate(
    orientation: Orientation, width_ps: float, light: Light
) -> None:
    found = _sum(Stage(orientation, width_ps, 7), [light], ["squares of 8 px", "holes of 8 px"], 4)
    assert _rate(found)[1] < FALSE_ALARMS, _told(found)
    assert found["seen"] > 0.95 * found["surface"], _told(found)


@pytest.mark.slow
@pytest.mark.parametrize("orientation", ["gate", "histogram"])
@pytest.mark.parametrize("width_ps", [200, 600, 1000])
@pytest.mark.parametrize("lost", PILE_UP)
def test_the_stated_rate_holds_for_100_to_1000_photons(
    orientation: Orientation, width_ps: float, lost: float
) -> None:
    lights = [
        Light(photons=photons, ratio=ratio, lost=lost)
        for photons, ratio in product((100, 300, 1000), (0.3, 1, 5))
    ]
    found = _sum(Stage(orientation, width_ps, 1), lights, EMPTY, 1)
    print(f"{orientation}, {width_ps} ps, pile-up {lost}: {_told(found)}")
    assert _rate(found)[2] < FALSE_ALARMS


@pytest.mark.slow
@pytest.mark.parametrize("orientation", ["gate", "histogram"])
@pytest.mark.parametrize("scene", EMPTY)
@pytest.mark.parametrize("sky", [0.2, 1, 5])
def test_dim_surfaces_and_another_sky_keep_the_stated_rate(
    orientation: Orientation, scene: str, sky: float
) -> None:
    found = Counter[str]()
    for width_ps in (200, 1000):
        for photons in (4, 10, 30):
            lights = [Light(photons=photons, ratio=ratio, sky=sky) for ratio in (0.3, 1, 5)]
            new = _sum(Stage(orientation, width_ps, photons), lights, [scene], 2)
            print(f"{orientation}, {scene}, sky {sky}, {width_ps} ps, {photons}: {_told(new)}")
            found += new
    print(f"{orientation}, {scene}, sky {sky}: {_told(found)}")
    assert _rate(found)[1] < FALSE_ALARMS


@pytest.mark.parametrize("rate", [1e-2, 1e-3])
@pytest.mark.parametrize("apart", [0.5, 2.0, 4.0])
def test_no_alternative_is_taken_for_true_more_often_than_stated(rate: float, apart: float) -> None:
    ratio = np.random.default_rng(0).normal(-(apart**2) / 2, apart, 400_000)
    assert (ratio > least_gain(rate)).mean() < 1.1 * rate
