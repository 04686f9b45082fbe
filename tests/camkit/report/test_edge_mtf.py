"""MTF by slanted edge against known blurs, under noise, and what is refused."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import erf

from camkit.errors import ContractError
from camkit.report.edge_mtf import edge_mtf
from camkit.scenes.slanted_edge import slanted_edge

Grid = NDArray[np.float64]

SIDE_PX = 100
ANGLES_DEG = (2.0, 3.5, 5.7, 10.0, 22.0, 33.0, 39.0, -7.0, -25.0)
CYCLES_PER_PX = np.linspace(0, 1, 41)
TOLERANCE = 0.01
"""Of the issue."""
UNBIASED = 0.005
"""Of the root of the mean power, over 600 draws at 100 photons."""


def distance(angle_rad: float, side_px: int = SIDE_PX, place_px: float = 0.3) -> Grid:
    """Give (side, side) distances from an upright edge a little beside the middle."""
    y, x = np.mgrid[:side_px, :side_px] - (side_px - 1) / 2
    return np.asarray((x - place_px) * math.cos(angle_rad) - y * math.sin(angle_rad))


def gaussian_edge(angle_deg: float, sigma_px: float, side_px: int = SIDE_PX) -> Grid:
    far = distance(math.radians(angle_deg), side_px)
    return np.asarray(0.5 + 0.3 * erf(far / (sigma_px * math.sqrt(2))))


def box_edge(angle_deg: float, width_px: float) -> Grid:
    far = distance(math.radians(angle_deg))
    return np.asarray(0.2 + 0.6 * np.clip(far / width_px + 0.5, 0, 1))


def gaussian_mtf(sigma_px: float, cycles_per_px: Grid = CYCLES_PER_PX) -> Grid:
    return np.asarray(np.exp(-2 * (math.pi * sigma_px * cycles_per_px) ** 2))


@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_blurs_are_measured_to_a_hundredth_up_to_twice_the_nyquist_limit(angle_deg: float) -> None:
    known = [(gaussian_edge(angle_deg, s), gaussian_mtf(s)) for s in (0.5, 1.0, 2.0, 3.0)]
    known += [(box_edge(angle_deg, w), np.abs(np.sinc(w * CYCLES_PER_PX))) for w in (1.0, 2.5)]
    for edge, expected in known:
        found = edge_mtf(edge, cycles_per_px=CYCLES_PER_PX)
        np.testing.assert_allclose(found.mtf, expected, rtol=0, atol=TOLERANCE)
        assert math.degrees(found.angle_rad) == pytest.approx(angle_deg, abs=0.01)


@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_a_square_pixel_has_the_mtf_of_its_shadow(angle_deg: float) -> None:
    angle = math.radians(angle_deg)
    along, across = CYCLES_PER_PX * math.cos(angle), CYCLES_PER_PX * math.sin(angle)
    edge = slanted_edge(SIDE_PX, SIDE_PX, angle_rad=angle)[1]
    found = edge_mtf(edge, cycles_per_px=CYCLES_PER_PX)
    expected = np.abs(np.sinc(along) * np.sinc(across))
    np.testing.assert_allclose(found.mtf, expected, rtol=0, atol=TOLERANCE)


def test_more_bins_measure_samples_that_are_small_beside_their_pitch() -> None:
    """A fifth of a pixel wide, as an array of low fill has them: to two cycles per pixel."""
    cycles = np.linspace(0, 2, 41)
    found = edge_mtf(box_edge(5.3, 0.2), cycles_per_px=cycles, bins_per_px=12)
    np.testing.assert_allclose(found.mtf, np.sinc(0.2 * cycles), rtol=0, atol=TOLERANCE)


def test_direction_and_polarity_do_not_matter() -> None:
    edge = gaussian_edge(5.7, 1.0)
    upright = edge_mtf(edge)
    assert upright.along_columns
    for turned, angle_rad in (
        (edge.T, upright.angle_rad),
        (edge[::-1], -upright.angle_rad),
        (edge[:, ::-1], -upright.angle_rad),
        (1 - edge, upright.angle_rad),
        (1 - edge.T, upright.angle_rad),
    ):
        found = edge_mtf(turned)
        np.testing.assert_allclose(found.mtf, upright.mtf, rtol=0, atol=1e-3)
        assert found.angle_rad == pytest.approx(angle_rad, abs=1e-5)
    assert not edge_mtf(edge.T).along_columns


def test_black_level_and_gain_do_not_matter() -> None:
    edge = gaussian_edge(5.7, 1.0)
    np.testing.assert_allclose(edge_mtf(64 + 900 * edge).mtf, edge_mtf(edge).mtf, atol=1e-9)


@pytest.mark.parametrize("cell", [((1, 0), (0, 1)), ((0, 0), (0, 1)), ((0, 1), (0, 1))])
def test_sites_of_a_mosaic_tell_what_all_samples_do(cell: tuple[tuple[int, int], ...]) -> None:
    """Green, red, and every other column; the rest is not looked at, whatever it holds."""
    sites = np.tile(np.array(cell, bool), (SIDE_PX // 2, SIDE_PX // 2))
    edge = np.where(sites, gaussian_edge(3.54, 1.0), np.nan)
    found = edge_mtf(edge, sites=sites, cycles_per_px=CYCLES_PER_PX)
    np.testing.assert_allclose(found.mtf, gaussian_mtf(1.0), rtol=0, atol=TOLERANCE)


def test_sharpening_shows_above_one() -> None:
    """Unsharp masking of a Gaussian: G + a G (1 - G)."""
    soft, softer = gaussian_edge(5.7, 1.0), gaussian_edge(5.7, math.sqrt(2))
    found = edge_mtf(soft + 2 * (soft - softer), cycles_per_px=CYCLES_PER_PX)
    mtf = gaussian_mtf(1.0)
    expected = mtf + 2 * (mtf - gaussian_mtf(math.sqrt(2)))
    np.testing.assert_allclose(found.mtf, expected, rtol=0, atol=TOLERANCE)
    assert found.mtf.max() > 1.05


def noisy(photons: float, sigma_px: float, seed: int) -> Grid:
    mean = gaussian_edge(5.7, sigma_px, 128) * photons
    return np.random.default_rng(seed).poisson(mean) / photons


@pytest.mark.parametrize("photons", [10_000, 1000, 100])
def test_poisson_noise_does_not_raise_the_power_of_a_curve_that_lies_above_it(
    photons: float,
) -> None:
    """Within what 60 draws tell; at 100 photons noise alone is 0.2 at 0.5, as is the curve."""
    cycles = np.array([0, 0.1, 0.25, 0.4, 0.5])
    found = [edge_mtf(noisy(photons, 0.5, s), cycles_per_px=cycles) for s in range(60)]
    curves = np.array([one.mtf for one in found])
    error = np.sqrt(np.mean(curves**2, axis=0)) - gaussian_mtf(0.5, cycles)
    assert (np.abs(error) < UNBIASED + 3 * curves.std(axis=0) / math.sqrt(len(curves))).all()
    angles = np.degrees([one.angle_rad for one in found])
    assert abs(angles.mean() - 5.7) < 0.02
    assert angles.std() < 0.1


def test_the_noise_told_is_the_power_that_noise_has_where_nothing_else_is() -> None:
    """A blur of 3 px leaves nothing at half a cycle: the bare power is then that of the noise."""
    cycles = np.array([0.5])
    found = [edge_mtf(noisy(1000, 3.0, s), cycles_per_px=cycles) for s in range(60)]
    # sqrt(max(power - noise, 0)): half of the draws lie below the median of an exponential
    share = np.mean([one.mtf[0] == 0 for one in found])
    assert share == pytest.approx(1 - math.exp(-1), abs=0.2)
    scatter = math.sqrt(np.mean([one.mtf[0] ** 2 for one in found]))
    # the mean of max(e - 1, 0) for e of an exponential distribution is 1 / e
    assert scatter == pytest.approx(found[0].noise[0] * math.exp(-0.5), rel=0.3)


def test_a_smooth_edge_has_no_noise() -> None:
    assert edge_mtf(gaussian_edge(5.7, 1.0)).noise.max() < 1e-6


def _with(value: float) -> Grid:
    edge = gaussian_edge(5.7, 1.0)
    edge[3, 4] = value
    return edge


def _curved() -> Grid:
    y, x = np.mgrid[:SIDE_PX, :SIDE_PX] - SIDE_PX / 2
    return np.where(np.hypot(x, y) < 30, 1.0, 0.0)


@pytest.mark.parametrize(
    ("picture", "reason"),
    [
        (np.zeros((SIDE_PX, SIDE_PX)), "no edge"),
        (np.ones(SIDE_PX), "h, w"),
        (np.zeros((8, 100)), "at least 16 px"),
        (_with(math.nan), "NaN"),
        (_with(math.inf), "NaN or infinite"),
        (np.random.default_rng(1).normal(size=(SIDE_PX, SIDE_PX)), "no edge, or too faint"),
        (noisy(1, 1.0, 0), "too faint"),
        (_curved(), "no edge"),
        (np.mgrid[:SIDE_PX, :SIDE_PX][1] + 0.1 * np.mgrid[:SIDE_PX, :SIDE_PX][0], "wider than"),
        (gaussian_edge(0.0, 1.0), "every position"),
        (gaussian_edge(0.2, 1.0), "every position"),
        (gaussian_edge(math.degrees(math.atan(0.25)), 1.0), "every position"),
        (gaussian_edge(43.0, 1.0), "43.0 degrees from the nearest axis"),
        (gaussian_edge(45.0, 1.0), "45.0 degrees from the nearest axis"),
        (gaussian_edge(5.7, 1.0)[:, 46:], "to one side|no edge|crosses"),
    ],
)
def test_what_cannot_be_measured_is_refused_in_one_line(picture: Grid, reason: str) -> None:
    with pytest.raises(ContractError, match=reason) as caught:
        edge_mtf(picture)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "wrong",
    [
        {"cycles_per_px": [2.0]},
        {"cycles_per_px": [-0.1]},
        {"cycles_per_px": 0.5},
        {"sites": np.ones((3, 3), bool)},
    ],
)
def test_what_does_not_fit_the_picture_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ContractError):
        edge_mtf(gaussian_edge(5.7, 1.0), **wrong)
