"""Kernels of plates that are not as they should be: nothing at the nominal value, sums kept."""

import math

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.report.kinds.spad.stress.kernels import (
    blurred,
    etched,
    opened,
    order_shares,
    shift_kernel,
    turned,
)
from tests.spad_bundle import leaning_kernel

FLOAT32 = 1e-6


@pytest.fixture
def kernel() -> FloatArray:
    return leaning_kernel()


def _moments(kernel: FloatArray) -> tuple[float, np.ndarray, np.ndarray]:
    """Give sum, middle and variances of a kernel, (y, x) in sub-pixels."""
    half = kernel.shape[0] // 2
    places = np.stack(np.mgrid[-half : half + 1, -half : half + 1]).reshape(2, -1)
    light = kernel.astype(np.float64).ravel()
    middle = places @ light
    return float(light.sum()), middle, (places**2) @ light - middle**2


@pytest.mark.parametrize(
    "same",
    [
        lambda k: turned(k, 0.0),
        lambda k: shift_kernel(k, 0.0),
        lambda k: blurred(k, 0.0),
        lambda k: etched(k, 8, 0.0),
        lambda k: opened(k, 0.0),
    ],
)
def test_the_nominal_value_gives_the_designed_kernel(same: object, kernel: FloatArray) -> None:
    assert callable(same)
    np.testing.assert_allclose(same(kernel), kernel, atol=FLOAT32)


@pytest.mark.parametrize(
    "other",
    [
        lambda k: turned(k, math.radians(7)),
        lambda k: shift_kernel(k, 0.3),
        lambda k: blurred(k, 2.5),
        lambda k: etched(k, 8, 0.2),
        lambda k: opened(k, 0.03),
        lambda k: opened(k, -0.02),
    ],
)
def test_every_kernel_has_unit_sum(other: object, kernel: FloatArray) -> None:
    assert callable(other)
    assert other(kernel).sum() == pytest.approx(1, abs=1e-5)


def test_a_quarter_turn_moves_x_to_y(kernel: FloatArray) -> None:
    np.testing.assert_allclose(turned(kernel, math.pi / 2), np.rot90(kernel, -1), atol=FLOAT32)


def test_a_turn_keeps_the_middle_at_its_distance(kernel: FloatArray) -> None:
    angle = math.radians(10)
    _, (y, x), _ = _moments(kernel)
    _, found, _ = _moments(turned(kernel, angle))
    c, s = math.cos(angle), math.sin(angle)
    np.testing.assert_allclose(found, [c * y + s * x * 1, c * x - s * y], atol=1e-5)


def test_a_shift_moves_the_middle_and_keeps_the_width(kernel: FloatArray) -> None:
    _, middle, width = _moments(kernel)
    _, found, as_wide = _moments(shift_kernel(kernel, 0.4))
    np.testing.assert_allclose(found, middle + 0.4, atol=1e-5)
    np.testing.assert_allclose(as_wide, width, atol=1e-4)


def test_a_disc_adds_its_own_variance(kernel: FloatArray) -> None:
    # an even disc has a sixteenth of its diameter squared along an axis
    _, _, width = _moments(kernel)
    _, _, found = _moments(blurred(kernel, 3.0))
    np.testing.assert_allclose(found - width, 9 / 16, rtol=0.01)


def test_a_larger_area_adds_its_variance_and_a_smaller_one_takes_it(kernel: FloatArray) -> None:
    _, _, width = _moments(kernel)
    for variance in (0.03, -0.02):
        _, _, found = _moments(opened(kernel, variance))
        np.testing.assert_allclose(found - width, variance, atol=1e-5)


def test_orders_hold_all_light_and_the_zeroth_grows_as_the_depth_errs() -> None:
    for error in (-0.3, 0.0, 0.05, 0.5):
        assert order_shares(8, error).sum() == pytest.approx(1)
    assert order_shares(8, 0.0) == pytest.approx([0, 1, 0, 0, 0, 0, 0, 0])
    shares = [order_shares(8, error)[0] for error in (0.0, 0.05, 0.1, 0.2)]
    assert shares == sorted(shares)
    # a plate of very many levels, pi / 2 too flat: the sinc of Goodman & Silvestri
    zero, first, *_ = order_shares(4096, -0.25)
    assert zero == pytest.approx(np.sinc(0.75) ** 2, abs=1e-4)
    assert first == pytest.approx(np.sinc(0.25) ** 2, abs=1e-4)


def test_a_plate_that_was_not_etched_is_none(kernel: FloatArray) -> None:
    found = etched(kernel, 8, -1.0)
    assert found[5, 5] == pytest.approx(1, abs=1e-5)


def test_a_plate_of_one_level_is_refused() -> None:
    with pytest.raises(ContractError, match="at least 2 levels"):
        order_shares(1, 0.1)
