"""Colours on their own lattices: samples come back, smooth light is found between them."""

from typing import get_args

import numpy as np
import pytest

from camkit.calibration.lattice import Lattice, filled
from camkit.cfa import CfaPattern, cfa_channels


def _of(cfa: CfaPattern, colour: int) -> tuple[Lattice, np.ndarray, np.ndarray]:
    """Give a lattice of y + 100 x where the colour lies and of NaN elsewhere, and its places."""
    y, x = np.indices((22, 30)).astype(np.float64)
    cell = np.array(cfa_channels(cfa))
    own = np.tile(cell, (11, 15)) == colour
    return Lattice.of_mosaic(np.where(own, y + 100 * x, np.nan), cfa, colour), y[own], x[own]


@pytest.mark.parametrize("cfa", get_args(CfaPattern))
@pytest.mark.parametrize("colour", [0, 1, 2])
def test_every_sample_of_a_colour_and_no_other_lies_on_its_lattice(
    cfa: CfaPattern, colour: int
) -> None:
    lattice, y, x = _of(cfa, colour)
    at_y, at_x = lattice.places()
    here = np.isfinite(lattice.values)
    assert here.sum() == y.size
    np.testing.assert_allclose(lattice.values[here], (at_y + 100 * at_x)[here], atol=1e-12)
    np.testing.assert_allclose(lattice.at(y, x), y + 100 * x, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("colour", [0, 1, 2])
def test_smooth_light_is_found_between_the_samples(colour: int) -> None:
    y, x = np.indices((64, 64)).astype(np.float64)
    light = np.cos(0.15 * y) * np.cos(0.11 * x)
    lattice = Lattice.of_mosaic(light, "GRBG", colour)
    at_y, at_x = np.mgrid[24:40:0.7, 24:40:0.7]
    wanted = np.cos(0.15 * at_y) * np.cos(0.11 * at_x)
    np.testing.assert_allclose(lattice.at(at_y, at_x), wanted, atol=3e-4)


def test_a_plane_is_its_own_lattice() -> None:
    plane = np.random.default_rng(0).random((9, 11))
    y, x = np.indices(plane.shape).astype(np.float64)
    np.testing.assert_allclose(Lattice.of_plane(plane).at(y, x), plane, atol=1e-12)


def test_what_is_missing_is_the_median_around_it_or_dark() -> None:
    values = np.arange(25, dtype=np.float64).reshape(5, 5)
    values[2, 2] = np.nan
    assert filled(values)[2, 2] == 12
    assert (filled(np.full((3, 3), np.nan)) == 0).all()
    whole = np.ones((2, 2))
    assert filled(whole) is whole
