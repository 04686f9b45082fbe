"""Kernels by distance: known distances are steps, mixtures lie between, else there is the mean."""

from itertools import pairwise

import numpy as np
import pytest

from camkit.psf import depth_weights
from camkit.runtime.bank.kernels_by_distance import (
    INTERVALS,
    MEAN,
    KernelsByDistance,
    NearnessMap,
    steps_between,
)
from camkit.runtime.bank.psf import FieldKernels
from tests.psf_factory import gaussian_kernel

DEPTHS_MM = np.array([500.0, 800.0, 2000.0])


def _kernels(depth_mm: float) -> FieldKernels:
    sigma_px = 0.8 + 3000 * abs(1 / depth_mm - 1 / 900)
    kernels = gaussian_kernel(sigma_px, radius_px=12).astype(np.float32)
    return FieldKernels(kernels=kernels[None], field_heights_mm=np.zeros(1))


KNOWN = KernelsByDistance(DEPTHS_MM, [_kernels(float(d)) for d in DEPTHS_MM])


def _map(*values: float) -> NearnessMap:
    return NearnessMap(values=np.array([values]), first_px=(0, 0), step_px=(1, 100))


@pytest.mark.parametrize(
    "depths_mm",
    [
        (500, 700, 1000, 1500),
        (500, 600, 700, 850, 1000, 1200, 1500),
        (500, 505, 1000),
        (1000, np.inf),
    ],
)
def test_every_known_distance_is_a_step_and_steps_between_are_even(
    depths_mm: tuple[float, ...],
) -> None:
    known = 1 / np.array(depths_mm, np.float64)[::-1]
    steps = steps_between(known)
    places = np.searchsorted(steps, known)
    np.testing.assert_array_equal(steps[places], known)
    assert abs(steps.size - 1 - INTERVALS) <= known.size / 2
    for first, last in pairwise(places):
        gaps = np.diff(steps[first : last + 1])
        np.testing.assert_allclose(gaps, gaps[0])


def test_a_known_distance_has_its_own_kernels_and_no_mixture() -> None:
    for depth_mm in DEPTHS_MM:
        found = KNOWN.at_step(KNOWN.step_of(1 / depth_mm))
        np.testing.assert_array_equal(found.kernels, _kernels(float(depth_mm)).kernels)


def test_kernels_of_a_step_are_linear_in_nearness_and_keep_their_light() -> None:
    for step, nearness in enumerate(KNOWN.nearness):
        shares = depth_weights(DEPTHS_MM, 1 / nearness)
        np.testing.assert_allclose(KNOWN.weights[step], shares, atol=1e-12)
        mixed = sum(s * k.kernels for s, k in zip(shares, map(_kernels, DEPTHS_MM), strict=True))
        np.testing.assert_allclose(KNOWN.at_step(step).kernels, mixed, atol=1e-7)


def test_kernels_where_nothing_tells_the_distance_are_the_mean() -> None:
    assert KNOWN.step_of(np.nan) == MEAN
    mean = np.mean([_kernels(float(d)).kernels for d in DEPTHS_MM], axis=0)
    np.testing.assert_allclose(KNOWN.at_step(MEAN).kernels, mean, atol=1e-7)
    beside = KNOWN.of_scene(_map(1 / 500, np.nan))
    assert beside.number_at(0, 0) == KNOWN.nearness.size - 1
    assert beside.number_at(40, 0) == KNOWN.nearness.size - 1
    assert beside.number_at(60, 0) == beside.number_at(100, 0) == MEAN


def test_infinity_is_a_distance() -> None:
    known = KernelsByDistance(np.array([1000.0, np.inf]), [_kernels(600.0), _kernels(2000.0)])
    assert (known.nearness[0], known.nearness[-1]) == (0, 1e-3)
    assert _map(0.0).to_json()["farthest_m"] == pytest.approx(1e6)


def test_a_sidecar_keeps_the_distances_that_something_tells() -> None:
    found = _map(1 / 500, np.nan, 1 / 2000).to_json()
    assert found["nearest_m"] == pytest.approx(0.5)
    assert found["farthest_m"] == pytest.approx(2.0)
    assert _map(np.nan).to_json() == {}


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((1 / 700,), "object distance estimated from the capture: 0.7 m"),
        (
            (1 / 500, 1 / 800, 1 / 2000),
            "object distance estimated from the capture: 0.8 m (0.5 to 2 m",
        ),
        ((np.nan,), "the object distance cannot be estimated"),
    ],
)
def test_people_read_how_far_the_scene_was_found(values: tuple[float, ...], text: str) -> None:
    assert _map(*values).describe().startswith(text)
