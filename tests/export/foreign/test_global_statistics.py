"""Means over the picture frozen, made local, and residuals put into the graph."""

from functools import cache

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray
from onnx import helper

from camkit.errors import BundleError
from camkit.export.foreign.canonical import canonical_graph
from camkit.export.foreign.global_statistics import (
    with_constants,
    with_local_means,
    with_residual,
)
from camkit.export.foreign.onnx_file import foreign_model
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.tiling import TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows
from tests.bundle_factory import make_model
from tests.foreign_networks import NAFNet, NormedUnet, exported, seeded

PICTURE = np.random.default_rng(3).random((1, 3, 96, 160)).astype(np.float32)


@cache
def _canonical(network: type) -> bytes:
    data = exported(seeded(network), "legacy", opset=17)
    return canonical_graph(foreign_model(onnx.load_from_string(data))).model


def _run(data: bytes, picture: NDArray[np.float32] = PICTURE) -> NDArray[np.float32]:
    return NetworkEngine(data, threads=1).run(picture)


@pytest.mark.parametrize("network", [NAFNet, NormedUnet])
def test_constants_of_a_picture_give_that_picture_and_no_global_operator(network: type) -> None:
    whole = _canonical(network)
    frozen = with_constants(whole, [PICTURE])
    facts = inspect_graph(frozen)
    assert not facts.global_operators
    assert facts.receptive_field_radius_px == inspect_graph(whole).receptive_field_radius_px
    np.testing.assert_allclose(_run(frozen), _run(whole), atol=2e-6)
    assert np.abs(_run(frozen, 0.3 * PICTURE) - _run(whole, 0.3 * PICTURE)).max() > 1e-4


@pytest.mark.parametrize("network", [NAFNet, NormedUnet])
def test_windows_larger_than_the_picture_are_the_whole(network: type) -> None:
    whole = _canonical(network)
    local = with_local_means(whole, 384)
    assert not inspect_graph(local).global_operators
    np.testing.assert_allclose(_run(local), _run(whole), atol=2e-5)


def test_local_means_are_those_of_windows_and_tile_exactly() -> None:
    nodes = [
        helper.make_node("GlobalAveragePool", ["input"], ["mean"], "pool"),
        helper.make_node("Sub", ["input", "mean"], ["output"], "rest"),
    ]
    data = make_model(nodes, {}, channels=(3, 3)).SerializeToString()
    local = with_local_means(data, 32)  # too small for cells: the exact mean of 33 x 33
    facts = inspect_graph(local)
    assert facts.receptive_field_radius_px == 16
    expected = PICTURE[0].astype(np.float64)
    y, x = 40, 71
    window = expected[:, y - 16 : y + 17, x - 16 : x + 17].mean(axis=(1, 2))
    np.testing.assert_allclose(_run(local)[0, :, y, x], expected[:, y, x] - window, atol=1e-5)
    corner = expected[:, :17, :17].mean(axis=(1, 2))
    np.testing.assert_allclose(_run(local)[0, :, 0, 0], expected[:, 0, 0] - corner, atol=1e-5)
    engine = NetworkEngine(local, threads=1)
    layout = lay_windows(96, 160, TileLimits(stride_px=1, halo_px=16, tile_px=32))
    bands = infer_bands(engine.run, ArrayRows(PICTURE[0]), layout, scale=1)
    np.testing.assert_array_equal(np.concatenate(list(bands), axis=1), _run(local)[0])


def test_an_extreme_of_the_whole_picture_has_no_local_mean() -> None:
    nodes = [
        helper.make_node("GlobalMaxPool", ["input"], ["most"], "pool"),
        helper.make_node("Div", ["input", "most"], ["output"], "share"),
    ]
    data = make_model(nodes, {}, channels=(3, 3)).SerializeToString()
    with pytest.raises(BundleError, match=r"pool: a GlobalMaxPool .* has no local mean"):
        with_local_means(data, 64)


def test_a_residual_is_of_the_last_plane() -> None:
    nodes = [helper.make_node("Conv", ["input", "w"], ["output"], "conv")]
    weight = np.random.default_rng(1).random((3, 7, 1, 1)).astype(np.float32)
    data = make_model(nodes, {"w": weight}, channels=(7, 3)).SerializeToString()
    picture = np.random.default_rng(2).random((1, 7, 8, 9)).astype(np.float32)
    plain = _run(data, picture)
    added = with_residual(data, (3, 3), subtracted=False)  # the seventh is a map of the noise
    np.testing.assert_allclose(_run(added, picture), picture[:, 3:6] + plain, atol=1e-6)
    taken = with_residual(data, (3, 3), subtracted=True)
    np.testing.assert_allclose(_run(taken, picture), picture[:, 3:6] - plain, atol=1e-6)
