import numpy as np
import pytest

from camkit.models_def.kinds.spad.sampling import gaussian_psf
from camkit.models_def.optics.dots.gerchberg_saxton import gerchberg_saxton
from camkit.models_def.optics.dots.merit import Merit
from camkit.models_def.optics.dots.refine import refine
from camkit.models_def.optics.dots.target import likeness, to_target
from camkit.models_def.optics.dots.unit import phase_light

TARGET = to_target(gaussian_psf(1.84))
MERIT = Merit(target=TARGET)


def test_refining_goes_far_beyond_gerchberg_and_saxton() -> None:
    begun = gerchberg_saxton(TARGET, 44, np.random.default_rng(0))
    phase, merit = refine(begun, MERIT)
    assert merit == pytest.approx(float(MERIT.of(phase_light(phase))))
    before, after = (likeness(phase_light(p), TARGET) for p in (begun, phase))
    assert before.rmse > 0.01
    assert after.rmse < before.rmse / 8
    assert after.correlation > 0.9999


def test_a_single_step_goes_downhill() -> None:
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, (16, 16))
    _, merit = refine(phase, MERIT, 1)
    assert merit < float(MERIT.of(phase_light(phase)))


def test_a_plate_that_is_right_stays() -> None:
    point = np.zeros((11, 11))
    point[5, 5] = 1
    phase, merit = refine(np.zeros((16, 16)), Merit(target=point))
    np.testing.assert_allclose(phase, 0, atol=1e-9)
    assert merit == pytest.approx(0, abs=1e-12)
