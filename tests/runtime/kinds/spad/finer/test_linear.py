"""The linear estimate against its equations written out, and what it makes of noise."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.finer.covariance import PictureCovariance
from camkit.runtime.kinds.spad.finer.linear import Grid, linear_estimate
from tests.spad_bundle import leaning_kernel

GRID = Grid(scale=4, phase=2)
NATURAL = PictureCovariance(contrast=0.634, reach=129.0, exponent=0.52)


def _written_out(kernel: np.ndarray, photons: float, sub_pixel: tuple[int, int]) -> np.ndarray:
    """Give the weights of one sub-pixel: every pixel as a row over a window of sub-pixels."""
    side, middle = 41, 20
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1)
    flat = places.reshape(-1, 2)
    gaps = np.hypot(*(flat[:, None] - flat).transpose(2, 0, 1))
    every = NATURAL.contrast**2 * np.exp(-((gaps / NATURAL.reach) ** NATURAL.exponent))
    rows = []
    for k in range(-3, 4):
        for j in range(-3, 4):
            row = np.zeros((side, side))
            y, x = middle + 4 * k, middle + 4 * j
            for (dy, dx), share in np.ndenumerate(kernel):
                # the light of a point moves by (dy - 5, dx - 5)
                at = y - (dy - 5), x - (dx - 5)
                if 0 <= at[0] < side and 0 <= at[1] < side:
                    row[at] += share
            rows.append(row.ravel())
    see = np.array(rows)
    wanted = (middle + sub_pixel[0] - GRID.phase) * side + middle + sub_pixel[1] - GRID.phase
    system = np.ones((50, 50))
    system[:49, :49] = see @ every @ see.T + np.eye(49) / photons
    system[49, 49] = 0
    right = np.append(see @ every[wanted], 1.0)
    return np.linalg.solve(system, right)[:49].reshape(7, 7)


@pytest.mark.parametrize("sub_pixel", [(0, 0), (2, 2), (1, 3)])
def test_weights_are_those_of_the_equations_written_out(sub_pixel: tuple[int, int]) -> None:
    """A narrow kernel, so that all light of the 7x7 pixels lies in the window."""
    kernel = np.zeros((11, 11), np.float32)
    kernel[4:7, 3:7] = leaning_kernel()[4:7, 3:7]
    kernel[7:, :] = 0
    kernel /= kernel.sum()
    found = linear_estimate(kernel, GRID, NATURAL, 40.0)
    expected = _written_out(kernel, 40.0, sub_pixel)
    own = found.weights[4 * sub_pixel[0] + sub_pixel[1]]
    np.testing.assert_allclose(own, expected, atol=2e-3 * np.abs(expected).max())


def test_a_flat_picture_stays_flat_up_to_its_border() -> None:
    found = linear_estimate(leaning_kernel(), GRID, NATURAL, 10.0)
    fine = found(np.full((2, 5, 6), 7.0, np.float32))
    assert fine.shape == (2, 20, 24)
    np.testing.assert_allclose(fine, 7.0, rtol=1e-5)


def test_the_noise_gain_is_that_of_counts() -> None:
    found = linear_estimate(leaning_kernel(), GRID, NATURAL, 50.0)
    counts = np.random.default_rng(0).poisson(50.0, (400, 12, 12)).astype(np.float32)
    inner = found(counts)[:, 16:32, 16:32]
    measured = inner.std(axis=0).reshape(4, 4, 4, 4).mean(axis=(0, 2))
    np.testing.assert_allclose(measured, found.noise_gain * np.sqrt(50), rtol=0.05)


def test_less_light_asks_more_pixels() -> None:
    gains = [
        float(linear_estimate(leaning_kernel(), GRID, NATURAL, n).noise_gain.mean())
        for n in (0.1, 10.0, 1000.0, np.inf)
    ]
    assert gains == sorted(gains)
    assert gains[0] < 0.2


@pytest.mark.parametrize("photons", [-1.0, np.nan])
def test_photons_that_cannot_be_are_refused(photons: float) -> None:
    with pytest.raises(ContractError, match="photons must be >= 0"):
        linear_estimate(leaning_kernel(), GRID, NATURAL, photons)


def test_a_kernel_without_a_middle_is_refused() -> None:
    with pytest.raises(ContractError, match=r"\(n, n\) with n odd"):
        linear_estimate(np.ones((4, 4), np.float32) / 16, GRID, NATURAL, 1.0)


def test_a_phase_outside_its_pixel_is_refused() -> None:
    with pytest.raises(ContractError, match=r"phase must be one of 0\.\.3"):
        Grid(scale=4, phase=4)


@pytest.mark.parametrize("values", [(0.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, 2.5)])
def test_a_covariance_that_cannot_be_is_refused(values: tuple[float, float, float]) -> None:
    contrast, reach, exponent = values
    with pytest.raises(ContractError, match="covariance"):
        PictureCovariance(contrast=contrast, reach=reach, exponent=exponent)
