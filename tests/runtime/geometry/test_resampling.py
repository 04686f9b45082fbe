"""Values between samples: no rings around lamps, and the kernel's own value everywhere else."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.arrays import FloatArray
from camkit.bundle.stages.undistort import Interpolation
from camkit.runtime.geometry.resampling import (
    FLOOR,
    SIDES_PX,
    WHITE,
    Maps,
    resampled,
    resampled_limited,
)

KERNELS: tuple[Interpolation, ...] = ("cubic", "lanczos")
SIZE = (24, 32)
LAST = (SIZE[1] - 1, SIZE[0] - 1)


def maps(shift: tuple[float, float], scale: float = 1.0) -> Maps:
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    places = np.stack([scale * x + shift[0], scale * y + shift[1]], axis=-1)
    return cv2.convertMaps(places, None, cv2.CV_16SC2)


def night(strength: float, seed: int) -> FloatArray:
    """Return a dark plane with lamps of one to nine pixels."""
    rng = np.random.default_rng(seed)
    plane = rng.uniform(0, 0.05, SIZE).astype(np.float32)
    for _ in range(4):
        y, x, side = rng.integers(0, 20), rng.integers(0, 28), rng.integers(1, 4)
        plane[y : y + side, x : x + side] = strength
    return plane


def square(plane: FloatArray, place: np.ndarray, side: int) -> FloatArray:
    """Return the samples that a value is made of, the border repeated."""
    reach = np.arange(side) - (side // 2 - 1)
    rows = np.clip(place[1] + reach, 0, plane.shape[0] - 1)
    columns = np.clip(place[0] + reach, 0, plane.shape[1] - 1)
    return plane[np.ix_(rows, columns)]


@pytest.mark.parametrize("kernel", KERNELS)
@settings(deadline=None, max_examples=10)
@given(
    strength=st.sampled_from([1.5, 6.0, 60.0, 200.0]),
    seed=st.integers(0, 99),
    shift=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    scale=st.floats(0.9, 1.1),
)
def test_no_lamp_has_a_ring_and_all_else_is_the_kernels(
    kernel: Interpolation, strength: float, seed: int, shift: tuple[float, float], scale: float
) -> None:
    plane, where = night(strength, seed), maps(shift, scale)
    kept = resampled(plane, where, interpolation=kernel)
    limited = resampled_limited(plane, where, interpolation=kernel)
    for at in np.ndindex(SIZE):
        samples = square(plane, where[0][at], SIDES_PX[kernel])
        low, high = samples.min(), samples.max()
        if (low <= WHITE < high) or kept[at] < FLOOR:
            assert limited[at] == np.clip(kept[at], low, high)
        elif (where[0][at] >= 0).all() and (where[0][at] < LAST).all():
            assert limited[at] == pytest.approx(kept[at], abs=1e-6)
    assert limited.min() >= FLOOR


@pytest.mark.parametrize("kernel", KERNELS)
def test_without_a_limit_there_are_rings(kernel: Interpolation) -> None:
    plane = night(60.0, 3)
    assert resampled(plane, maps((0.5, 0.5)), interpolation=kernel).min() < -5


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_picture_without_lamps_keeps_every_bit(kernel: Interpolation) -> None:
    """Values that overshoot white stay, since that keeps edges sharp."""
    plane = cv2.GaussianBlur(np.random.default_rng(0).random(SIZE, np.float32), (0, 0), 0.7)
    plane[:, 20:] = np.minimum(plane[:, 20:] + 0.4, WHITE)
    where = maps((0.4, -0.3))
    kept = resampled(plane, where, interpolation=kernel)
    assert kept.max() > WHITE
    np.testing.assert_array_equal(resampled_limited(plane, where, interpolation=kernel), kept)


@pytest.mark.parametrize("kernel", KERNELS)
def test_inside_light_above_white_the_kernel_stays(kernel: Interpolation) -> None:
    rng = np.random.default_rng(1)
    plane = rng.uniform(1.2, 3.0, SIZE).astype(np.float32)
    where = maps((0.5, 0.5))
    kept = resampled(plane, where, interpolation=kernel)
    np.testing.assert_array_equal(resampled_limited(plane, where, interpolation=kernel), kept)


def test_no_number_spreads_no_farther_than_its_kernel() -> None:
    plane = night(60.0, 3)
    plane[12, 16] = np.nan
    where = maps((0.25, 0.25))
    lost = np.isnan(resampled(plane, where, interpolation="cubic"))
    np.testing.assert_array_equal(
        np.isnan(resampled_limited(plane, where, interpolation="cubic")), lost
    )
