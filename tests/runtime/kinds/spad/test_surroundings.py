"""Empty pixels beside surfaces are believed no more often than is stated, in both orientations."""

import numpy as np
import pytest

from camkit.runtime.kinds.spad.pulse import GatedPulse
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way
from camkit.runtime.kinds.spad.time_axis import Orientation, TimeAxis

HEIGHT, WIDTH, BINS = 32, 64, 125


@pytest.mark.parametrize("orientation", ["gate", "histogram"])
@pytest.mark.parametrize(
    ("photons", "ratio", "width_ps"), [(100, 1, 1000), (300, 5, 600), (1000, 5, 1000), (30, 1, 200)]
)
def test_empty_pixels_beside_surfaces_keep_the_false_alarm_rate(
    orientation: Orientation, photons: float, ratio: float, width_ps: float
) -> None:
    axis = TimeAxis.regular(orientation, bins=BINS, time_bin_ps=20.0)
    pulse = GatedPulse(width_ps=width_ps, rc_ps=60.0, sigma_ps=42.5)
    sharpener, rng = Sharpener(axis, pulse, Way()), np.random.default_rng(7)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    is_empty = (y // 8 % 2 == 0) | (x // 8 % 2 == 0)  # squares of 8 pixels, 8 apart
    share = axis.shares(pulse, np.array([1200.0]), np.arange(BINS)[None])[0]
    mean = np.where(is_empty[..., None], 0.0, photons * share) + photons / ratio / BINS
    believed = surfaces = 0.0
    for _ in range(4):
        valid = sharpener.strip(rng.poisson(mean).astype(np.float32)).valid[0]
        believed += valid[is_empty].mean() / 4
        surfaces += valid[~is_empty].mean() / 4
    assert believed < 3e-3  # 0.1 % of 6144 pixels, and what chance and clumps add
    assert surfaces > 0.85
