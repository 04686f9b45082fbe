"""The line of photon transfer."""

import numpy as np
import pytest

from camkit.calibration.noise.transfer import Point, fit_transfer
from camkit.errors import DecodeError

SAMPLES = 60_000
DARK = Point(signal=0.0, variance=2.0, samples=SAMPLES)


def _points(slope: float, chance: np.ndarray | float = 0.0) -> list[Point]:
    signal = np.geomspace(50, 3000, 8)
    variance = (2.0 + slope * signal) * (1 + chance)
    return [Point(signal=s, variance=v, samples=SAMPLES) for s, v in zip(signal, variance, strict=True)]  # noqa: E501 # fmt: skip


def test_a_line_is_found_exactly() -> None:
    line = fit_transfer(_points(0.25), DARK)
    assert line.dn_per_e == pytest.approx(0.25, rel=1e-9)
    assert line.dark_variance == pytest.approx(2.0, rel=1e-9)
    assert np.abs(line.misfits()).max() < 1e-9


def test_the_stated_error_is_what_chance_does() -> None:
    rng = np.random.default_rng(0)
    lines = [
        fit_transfer(_points(0.25, np.sqrt(2 / SAMPLES) * rng.standard_normal(8)), DARK)
        for _ in range(200)
    ]
    scatter = np.std([line.dn_per_e for line in lines])
    assert np.median([line.error for line in lines]) == pytest.approx(scatter, rel=0.25)


def test_noise_that_does_not_grow_with_light_is_refused() -> None:
    with pytest.raises(DecodeError, match="does not grow with the light"):
        fit_transfer([*_points(0.0)[:2], Point(signal=4e3, variance=0.5, samples=SAMPLES)], DARK)
