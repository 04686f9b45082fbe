import numpy as np
import pytest

from camkit.calibration.lattice import Lattice
from camkit.calibration.light import background, find_light, fit_core
from camkit.errors import DecodeError


def _cells() -> np.ndarray:
    cells = np.random.default_rng(0).normal(0.1, 0.01, (60, 80))
    cells[40:42, 20:22] += 3
    return cells


def test_the_brightest_light_is_found_and_a_lone_defect_is_not() -> None:
    cells = _cells()
    cells[10, 70] = 1e4
    row, column = find_light(cells)
    assert abs(row - 40.5) <= 1
    assert abs(column - 20.5) <= 1


def test_noise_alone_is_no_light() -> None:
    with pytest.raises(DecodeError, match="no point light"):
        find_light(np.random.default_rng(0).normal(0.1, 0.01, (60, 80)))


@pytest.mark.parametrize("cut", [False, True])
def test_level_and_spread_of_the_dark_also_where_it_is_cut_at_black(cut: bool) -> None:
    rng = np.random.default_rng(1)
    dark = rng.normal(0, 1, (200, 200))
    level = 0.0
    if cut:
        dark, level = np.maximum(dark, 0), 1 / np.sqrt(2 * np.pi)
    dark[3, 3], dark[2, 5], dark[80:120, 80:120] = 1e5, np.nan, 50
    found, spread = background([dark])
    assert found == pytest.approx(level, abs=0.02)
    assert spread == pytest.approx(1, abs=0.03)


def test_a_border_without_a_sample_is_refused() -> None:
    with pytest.raises(DecodeError, match="clipped along its border"):
        background([np.full((40, 40), np.nan)])


@pytest.mark.parametrize("colour", [0, 1, 2])
def test_a_slanted_core_is_fitted_on_any_lattice(colour: int) -> None:
    y, x = np.indices((60, 60)).astype(np.float64)
    c, s = np.cos(0.5), np.sin(0.5)
    u, v = c * (y - 30.37) + s * (x - 28.81), c * (x - 28.81) - s * (y - 30.37)
    light = 7 * np.exp(-0.5 * ((u / 1.1) ** 2 + (v / 2.3) ** 2))
    core = fit_core(Lattice.of_mosaic(light, "BGGR", colour), 31.0, 28.0)
    assert (core.y, core.x) == pytest.approx((30.37, 28.81), abs=1e-4)
    np.testing.assert_allclose(core.at(y, x), light, atol=1e-3)


def test_a_light_that_is_dark_in_one_colour_is_refused() -> None:
    with pytest.raises(DecodeError, match="dark in one colour"):
        fit_core(Lattice.of_plane(np.zeros((30, 30))), 15.0, 15.0)
