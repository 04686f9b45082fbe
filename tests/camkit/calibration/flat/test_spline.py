"""Splines are smooth, hold polynomials, and the lens's begin flat at the centre."""

import numpy as np
import pytest

from camkit.calibration.flat.spline import Radial, Surface, bump_slopes, bumps

EXACT = 1e-10


def test_all_splines_together_are_one() -> None:
    assert np.abs(bumps(np.linspace(0, 1, 101), 5).sum(axis=1) - 1).max() < EXACT


def test_slopes_are_those_of_the_splines() -> None:
    place = np.linspace(0.01, 0.99, 50)
    step = 1e-6
    wanted = (bumps(place + step, 4) - bumps(place - step, 4)) / (2 * step)
    assert bump_slopes(place, 4) == pytest.approx(wanted, abs=1e-7)


def test_the_lens_is_zero_and_level_at_its_centre() -> None:
    radial = Radial(1.1, 6)
    assert np.abs(radial.terms(np.zeros(1))).max() < EXACT
    assert np.abs(radial.slopes(np.zeros(1))).max() < EXACT


def test_the_lens_holds_even_polynomials() -> None:
    radius = np.linspace(0, 1, 40)
    terms = Radial(1.1, 6).terms(radius)
    for power in (2, 4, 6):
        left = radius**power - terms @ np.linalg.lstsq(terms, radius**power)[0]
        assert np.abs(left).max() < EXACT


def test_a_surface_holds_polynomials_of_a_place() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-1, 2, 500), rng.uniform(-0.5, 1, 500)
    terms = Surface(x, y, 0.4).terms(x, y)
    wanted = 1 + x - 2 * y + x**2 * y + x**3 - y**3
    assert np.abs(wanted - terms @ np.linalg.lstsq(terms, wanted)[0]).max() < EXACT


def test_a_surface_of_one_place_is_finite() -> None:
    one = np.zeros(3)
    assert np.isfinite(Surface(one, one, 0.25).terms(one, one)).all()
