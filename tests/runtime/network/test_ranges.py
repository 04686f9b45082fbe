"""Activations are measured inside the network, and fp16 is judged by them."""

import numpy as np
import pytest

from camkit.errors import BundleError
from camkit.runtime.network.ranges import FP16_LIMIT, fits_fp16, node_activations
from tests.bundle_factory import tiny_forward, tiny_network


def _windows(*levels: float) -> list[np.ndarray]:
    return [np.full((1, 6, 16, 16), level, np.float32) for level in levels]


def test_largest_activation_of_the_output_is_that_of_its_definition() -> None:
    found = node_activations(tiny_network(), _windows(0.5, 2.0))
    expected = np.abs(tiny_forward(_windows(2.0)[0][0])).max()
    assert found["output"] == pytest.approx(expected, rel=1e-5)
    assert set(found) == {"head", "active", "body", "sum", "tail", "fine", "wiener", "output"}


def test_activations_grow_with_the_input() -> None:
    small = node_activations(tiny_network(), _windows(1.0))
    large = node_activations(tiny_network(), _windows(3.0))
    assert all(large[name] == pytest.approx(3 * small[name], rel=1e-5) for name in small)


def test_nan_is_reported_not_hidden() -> None:
    assert np.isnan(node_activations(tiny_network(), _windows(np.nan, 1.0))["output"])


def test_model_that_is_none_is_refused() -> None:
    with pytest.raises(BundleError):
        node_activations(b"nothing", _windows(1.0))


@pytest.mark.parametrize(("value", "fits"), [(FP16_LIMIT / 4, False), (FP16_LIMIT / 4.01, True)])
def test_headroom_counts(value: float, fits: bool) -> None:
    assert fits_fp16({"a": 1.0, "b": value}, headroom=4.0) is fits


def test_nan_never_fits() -> None:
    assert not fits_fp16({"a": float("nan")}, headroom=1.0)
