"""Light recorded behind a mosaic: its mean, its noise, its steps and where it clips."""

import numpy as np
import pytest
import torch

from camkit.cfa import CFA_PATTERNS, cfa_channels
from camkit.models_def.sensors.exposure import expose
from tests.camera_factory import make_sensor

GAINS = (2.0, 1.0, 1.5)
SIDE = 128


def _even(level: float) -> torch.Tensor:
    return torch.full((1, 3, SIDE, SIDE), level)


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_a_sample_has_the_light_of_its_colour_before_white_balance(cfa: str) -> None:
    sensor = make_sensor(cfa=cfa)
    light = torch.tensor([0.2, 0.3, 0.6]).reshape(1, 3, 1, 1).expand(1, 3, SIDE, SIDE)
    raw, clipped = expose(light, GAINS, sensor, 100.0, np.random.default_rng(0))
    assert raw.shape == clipped.shape == (SIDE, SIDE)
    assert not clipped.any()
    for y, x in np.ndindex(2, 2):
        colour = cfa_channels(cfa)[y][x]  # type: ignore[arg-type]
        wanted = (0.2, 0.3, 0.6)[colour] / GAINS[colour]
        assert raw[y::2, x::2].mean() == pytest.approx(wanted, rel=2e-3)


@pytest.mark.parametrize("iso", [100.0, 1600.0])
@pytest.mark.parametrize("level", [0.05, 0.5])
def test_noise_is_that_of_photons_and_of_reading(iso: float, level: float) -> None:
    sensor = make_sensor()
    raw, _ = expose(_even(level), (1.0, 1.0, 1.0), sensor, iso, np.random.default_rng(1))
    noise = sensor.noise_at(iso)
    step = 1 / (sensor.white_level - sensor.black_level)
    wanted = noise.shot[0] * level + noise.read_variance[0] + step**2 / 12
    assert raw.var(dtype=np.float64) == pytest.approx(wanted, rel=0.06)


def test_samples_are_whole_numbers_between_black_and_white() -> None:
    sensor = make_sensor()
    levels = sensor.white_level - sensor.black_level
    ramp = torch.linspace(0, 2, SIDE).expand(1, 3, SIDE, SIDE)
    raw, clipped = expose(ramp, GAINS, sensor, 3200.0, np.random.default_rng(0))
    dn = raw.astype(np.float64) * levels
    np.testing.assert_allclose(dn, np.rint(dn), atol=1e-3)
    assert raw.max() == 1
    assert raw.min() >= -sensor.black_level / levels
    assert (raw[:, 0] < 0).any()
    np.testing.assert_array_equal(clipped, raw >= 1)


def test_a_colour_clips_at_its_gain() -> None:
    sensor = make_sensor(cfa="RGGB")
    raw, clipped = expose(_even(1.7), GAINS, sensor, 100.0, np.random.default_rng(0))
    assert not clipped[0::2, 0::2].any()  # red, gain 2
    assert clipped[0::2, 1::2].all()
    assert clipped[1::2, 0::2].all()
    assert clipped[1::2, 1::2].mean() > 0.99
    assert (raw <= 1).all()


def test_the_generator_decides_the_noise() -> None:
    sensor = make_sensor()
    one, same, other = (
        expose(_even(0.3), GAINS, sensor, 100.0, np.random.default_rng(seed))[0]
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()
