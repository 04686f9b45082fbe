"""The star of a windshield by its closed forms."""

import math

import numpy as np
import pytest

from camkit.models_def.kinds.hdr.thesis.star import draw_angle_rad, star_kernel
from camkit.models_def.kinds.hdr.thesis_recipe import GlareRecipe

GLARE = GlareRecipe()


@pytest.mark.parametrize("angle_deg", [0.0, 5.0, -8.0, 30.0])
def test_arms_hold_the_integral_of_their_profile(angle_deg):
    kernel = star_kernel(GLARE, math.radians(angle_deg))
    assert kernel.shape == (481, 481)
    assert kernel.sum() == pytest.approx(1, abs=1e-5)
    core = kernel[240, 240]
    end = GLARE.reach_px / math.cos(math.radians(angle_deg))
    arms = 2 * GLARE.beta / GLARE.m * (1 - math.exp(-GLARE.m * end))
    # the pixel of the light itself holds one unit of the arms less
    assert (1 - core) / core == pytest.approx(arms, abs=2 * GLARE.beta)


def test_light_falls_off_as_m_says():
    kernel = star_kernel(GLARE, 0.0).astype(float)
    line = kernel[:, 240]
    assert np.count_nonzero(kernel) == 481
    ratios = line[242:300] / line[241:299]
    np.testing.assert_allclose(ratios, math.exp(-GLARE.m), rtol=1e-5)
    np.testing.assert_allclose(line[:240], line[:240:-1])


@pytest.mark.parametrize("angle_deg", [2.5, 8.0, -5.0, 40.0])
def test_arms_lie_at_the_angle_asked_for(angle_deg):
    kernel = star_kernel(GLARE, math.radians(angle_deg)).astype(float)
    kernel[240, 240] = 0
    y, x = np.mgrid[-240:241, -240:241]
    across, along = (kernel * x * y).sum(), (kernel * y * y).sum()
    assert math.degrees(math.atan2(-across, along)) == pytest.approx(angle_deg, abs=0.01)


def test_angles_are_drawn_to_both_sides_between_the_limits():
    rng = np.random.default_rng(1)
    drawn = np.degrees([draw_angle_rad(GLARE, rng) for _ in range(400)])
    assert 2.5 <= np.abs(drawn).min() < 2.7
    assert 7.8 < np.abs(drawn).max() <= 8
    assert 0.4 < (drawn > 0).mean() < 0.6
