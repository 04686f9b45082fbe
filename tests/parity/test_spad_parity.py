"""Single photons in numpy and in torch: the same array, the same planes, the same theory."""

import numpy as np
import pytest
import torch

from camkit.models_def.kinds.spad.counting import Exposure, told_planes
from camkit.models_def.kinds.spad.sampling import see_through as see_in_torch
from camkit.models_def.kinds.spad.theory import LAGS, Covariance, wiener_error
from camkit.runtime.kinds.spad.finer.camera import network_planes
from camkit.runtime.kinds.spad.finer.covariance import PictureCovariance
from camkit.runtime.kinds.spad.finer.linear import Grid, linear_estimate
from camkit.runtime.kinds.spad.twin.array import see_through
from tests.spad_bundle import leaning_kernel


@pytest.mark.parametrize("phase", range(4))
def test_the_array_sees_the_same_light(phase: int) -> None:
    fine = np.random.default_rng(phase).random((3, 32, 48)).astype(np.float32)
    own = see_through(fine, leaning_kernel(), Grid(scale=4, phase=phase))
    kernel = torch.from_numpy(leaning_kernel())
    other = see_in_torch(torch.from_numpy(fine)[:, None], kernel, phase)[:, 0].numpy()
    np.testing.assert_allclose(own, other, atol=1e-6)


def test_a_network_is_given_what_it_was_trained_with() -> None:
    exposure = Exposure(photons=40.0, dark_counts=3.0)
    counts = np.random.default_rng(0).poisson(20.0, (1, 1, 6, 7)).astype(np.float32)
    other = told_planes(torch.from_numpy(counts), exposure)[0].numpy()
    own = network_planes(counts[0, 0] - 3, 40.0, 3.0)
    np.testing.assert_allclose(own, other, rtol=1e-6)


@pytest.mark.parametrize("photons", [20.0, 2000.0])
def test_the_linear_estimate_errs_as_theory_says(photons: float) -> None:
    """Theory knows the mean of pictures, the estimate does not: it may err a little more."""
    mean, reach = 0.4, 25.0
    covariance = PictureCovariance(contrast=0.6, reach=reach, exponent=1.0)
    values = torch.from_numpy(covariance.lags(LAGS) * mean**2)
    theory = float(
        wiener_error(
            torch.from_numpy(leaning_kernel()), Covariance(values=values, mean=mean), photons
        )
    )
    grid = Grid(scale=4, phase=2)
    weights = linear_estimate(leaning_kernel(), grid, covariance, photons * mean).weights
    # the error of weights w is w' A w - 2 w' b + C(0): by the same moments, explicitly
    found = _error_of(weights.astype(np.float64), covariance, mean, photons)
    assert theory * (1 - 1e-4) <= found <= theory * 1.03


def _error_of(
    weights: np.ndarray, covariance: PictureCovariance, mean: float, photons: float
) -> float:
    lags = covariance.lags(50) * mean**2
    kernel = leaning_kernel().astype(np.float64)
    taps = [(dy - 5, dx - 5, share) for (dy, dx), share in np.ndenumerate(kernel)]
    at = [(4 * k, 4 * j) for k in range(-3, 4) for j in range(-3, 4)]

    def common(dy: np.ndarray, dx: np.ndarray) -> np.ndarray:
        return np.asarray(lags[50 + dy, 50 + dx])

    moves = np.array([(y, x) for y, x, _ in taps])
    shares = np.array([share for _, _, share in taps])
    pair_y, pair_x = moves[:, None].transpose(2, 0, 1) - moves[None].transpose(2, 0, 1)
    both = shares[:, None] * shares
    matrix = (
        np.array(
            [
                [
                    float((both * common(a[0] - b[0] - pair_y, a[1] - b[1] - pair_x)).sum())
                    for b in at
                ]
                for a in at
            ]
        )
        + np.eye(49) * mean / photons
    )
    errors = []
    for sub_pixel, own in enumerate(weights.reshape(16, 49)):
        fine = sub_pixel // 4 - 2, sub_pixel % 4 - 2
        cross = np.array(
            [
                float((shares * common(fine[0] - y + moves[:, 0], fine[1] - x + moves[:, 1])).sum())
                for y, x in at
            ]
        )
        errors.append(own @ matrix @ own - 2 * own @ cross + lags[50, 50])
    return float(np.mean(errors))
