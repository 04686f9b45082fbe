"""Kernels come back from the profiles of edges in all directions."""

import numpy as np
import pytest

from camkit.calibration.blur.blob_basis import Blobs
from camkit.calibration.blur.kernel_solve import EdgeSums, solve_weights

BLOBS = Blobs.of(7.0)
DISTANCE_PX = np.arange(-8, 8, 0.5)


def coma() -> np.ndarray:
    """Weights of a kernel that is wide outward and has its light to one side."""
    u, v = BLOBS.u_px, BLOBS.v_px
    weights = np.exp(-((u + 1) ** 2) / 2 - v**2 / 2) + 0.2 * np.exp(-((u - 3) ** 2) / 4 - v**2 / 2)
    weights *= BLOBS.spread_px**2 * (BLOBS.spread_px < 1)
    return weights / weights.sum()


def sums_of(weights: np.ndarray, noise: float) -> EdgeSums:
    rng = np.random.default_rng(0)
    sums = EdgeSums.empty(1, BLOBS.count)
    for angle in rng.uniform(0, 2 * np.pi, 120):
        rises = BLOBS.rises(DISTANCE_PX, np.cos(angle), abs(np.sin(angle)))
        seen = rises @ weights + rng.normal(size=DISTANCE_PX.size) * noise
        sums.add(rises, seen, np.full(DISTANCE_PX.size, 1e4), np.ones(1))
    return sums


def test_a_kernel_with_coma_comes_back_with_its_side():
    weights = coma()
    solved = solve_weights(
        sums_of(weights, 0.005), BLOBS, 1e-4, is_reference=False, is_round=False
    )[0]
    kernels = [BLOBS.kernels(one, 9) for one in (weights, solved)]
    assert np.abs(kernels[0] - kernels[1]).sum() < 0.12
    rows = [kernel.sum(axis=1) @ np.arange(-9, 10) for kernel in kernels]
    assert rows[1] == pytest.approx(rows[0], abs=0.05)


def test_the_reference_colour_lies_around_its_middle():
    solved = solve_weights(sums_of(coma(), 0.005), BLOBS, 1e-4, is_reference=True, is_round=False)[
        0
    ]
    assert abs(solved @ BLOBS.u_px) < 0.6 * abs(coma() @ BLOBS.u_px) + 0.05


def test_kernels_on_the_axis_are_round():
    solved = solve_weights(sums_of(coma(), 0.005), BLOBS, 1e-4, is_reference=True, is_round=True)
    kernel = BLOBS.kernels(solved[0], 9)
    assert np.abs(kernel - kernel.T).max() < 0.02 * kernel.max()


def test_sums_add_up_and_tell_the_misfit():
    weights = coma()
    sums = sums_of(weights, 0.0)
    assert sums.misfit(weights[None]) == pytest.approx(0, abs=1e-9)
    half = sums.plus(sums, -0.5)
    assert half.weight == pytest.approx(sums.weight / 2)
    assert sums.misfit(np.full((1, BLOBS.count), 1 / BLOBS.count)) > 1e-3


def test_an_edge_behind_one_blob_rises_in_its_place():
    middle = BLOBS.rises(np.array([0.0]), 0.6, 0.8)[0]
    at_origin = (BLOBS.u_px == 0) & (BLOBS.v_px == 0)
    assert middle[at_origin] == pytest.approx(0.5)
    outward = (BLOBS.u_px == 3) & (BLOBS.v_px == 0)
    assert BLOBS.rises(np.array([1.8]), 0.6, 0.8)[0][outward] == pytest.approx(0.5)
