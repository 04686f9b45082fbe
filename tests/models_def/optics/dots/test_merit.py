import numpy as np
import pytest

from camkit.models_def.kinds.spad.sampling import gaussian_psf
from camkit.models_def.optics.dots.merit import Merit
from camkit.models_def.optics.dots.target import likeness, to_target

TARGET = to_target(gaussian_psf(1.84))
MERIT = Merit(target=TARGET)


def test_all_light_in_its_place_is_no_fault() -> None:
    assert float(MERIT.of(TARGET)) == pytest.approx(0, abs=1e-12)
    assert float(MERIT.of(0.9 * TARGET)) == pytest.approx(0.1)


def test_likeness_counts_as_its_weight_says() -> None:
    light = TARGET * (1 + 0.01 * np.random.default_rng(0).normal(size=TARGET.shape))
    light /= light.sum()
    apart = float(((light - TARGET) ** 2).mean()) / TARGET.max() ** 2
    assert float(MERIT.of(light)) == pytest.approx(MERIT.weight * apart)
    assert apart == pytest.approx(likeness(light, TARGET).rmse ** 2, rel=0.3)


def test_the_slope_is_that_of_differences() -> None:
    light = np.random.default_rng(1).random((11, 11)) / 200
    slope = MERIT.slope(light)
    for place in ((0, 0), (5, 5), (3, 9)):
        step = np.zeros_like(light)
        step[place] = 1e-7
        difference = float(MERIT.of(light + step) - MERIT.of(light - step)) / 2e-7
        assert slope[place] == pytest.approx(difference, rel=1e-6)


def test_many_lights_are_judged_at_once() -> None:
    lights = np.random.default_rng(2).random((3, 2, 11, 11))
    one_by_one = [[float(MERIT.of(light)) for light in row] for row in lights]
    np.testing.assert_allclose(MERIT.of(lights), one_by_one)
