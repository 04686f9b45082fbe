"""The shipped networks: torch = onnxruntime, tiled = whole, probe <= graph walk."""

from functools import cache

import numpy as np
import pytest
import torch
from torch import nn

from camkit.arrays import FloatArray
from camkit.export.onnx_graph import to_onnx
from camkit.models_def.networks.catalog import build_network
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.probe import perturbation_reach
from camkit.runtime.network.tiling import TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows

# lattice halo in px: what exact tiling needs; full_unet has its own file
HALOS_PX = {"lean_s": 56, "lean_m": 96, "lean_l": 96, "trimmed_unet": 24}
ROOMY = 2**40


@cache
def _exported(name: str) -> tuple[nn.Module, bytes]:
    torch.manual_seed(6)
    network = build_network(name)
    if hasattr(network, "tail"):
        nn.init.normal_(network.tail.weight, std=0.05)
    return network.eval(), to_onnx(network)


def _picture(height: int, width: int) -> FloatArray:
    rng = np.random.default_rng(height * width)
    picture: FloatArray = rng.random((6, height, width), dtype=np.float32)
    return picture


def _infer(engine: NetworkEngine, picture: FloatArray, limits: TileLimits) -> FloatArray:
    layout = lay_windows(picture.shape[1], picture.shape[2], limits)
    return np.concatenate(list(infer_bands(engine.run, ArrayRows(picture), layout)), axis=1)


def _limits(name: str, **changes: object) -> TileLimits:
    stride = build_network(name).stride_px
    values = {"stride_px": stride, "halo_px": HALOS_PX[name], "max_bytes": ROOMY, **changes}
    return TileLimits(**values)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", HALOS_PX)
def test_onnxruntime_reproduces_torch(name: str) -> None:
    network, model = _exported(name)
    engine = NetworkEngine(model, threads=2)
    window = _picture(144, 80)[None]
    with torch.no_grad():
        expected = network(torch.from_numpy(window)).numpy()
    tolerance = 1e-5 * max(1.0, float(np.abs(expected).max()))
    assert np.abs(engine.run(window) - expected).max() <= tolerance


@pytest.mark.parametrize("name", HALOS_PX)
@pytest.mark.parametrize("size", [(1, 1), (31, 17), (9, 400), (210, 230)])
def test_tiled_equals_whole_bit_for_bit(name: str, size: tuple[int, int]) -> None:
    _, model = _exported(name)
    picture = _picture(*size)
    whole = _infer(NetworkEngine(model, threads=1), picture, _limits(name, whole=True))
    for threads in (1, 2):
        engine = NetworkEngine(model, threads=threads)
        for tile_px in (16, 64):
            assert np.array_equal(_infer(engine, picture, _limits(name, tile_px=tile_px)), whole)


@pytest.mark.parametrize("name", HALOS_PX)
def test_probe_stays_within_the_graph_walk_and_the_stated_halo(name: str) -> None:
    _, model = _exported(name)
    facts = inspect_graph(model)
    reach = perturbation_reach(
        NetworkEngine(model, threads=2).run,
        272,
        np.random.default_rng(0),
        stride_px=facts.stride_px,
        channels=facts.input_channels,
    )
    assert reach.halo_px <= facts.receptive_field_radius_px <= HALOS_PX[name]
    assert HALOS_PX[name] - facts.stride_px < reach.halo_px
    assert facts.unblocked_convolutions == () or name == "trimmed_unet"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lean_s", "lean_m"])
def test_24_megapixels_tiled_equal_whole(name: str) -> None:
    _, model = _exported(name)
    picture = _picture(4000, 6000)
    whole = _infer(NetworkEngine(model, threads=2), picture, _limits(name, whole=True))
    limits = _limits(name, max_bytes=480 * 10**6)
    assert lay_windows(4000, 6000, limits).window_count > 10
    engine = NetworkEngine(model, threads=2)
    assert np.array_equal(_infer(engine, picture, limits), whole)


@pytest.mark.slow
@pytest.mark.parametrize("tile_px", [256, 512, 1024])
@pytest.mark.parametrize("size", [(1, 4000), (2999, 4001)])
def test_network_m_tiled_equals_whole_at_odd_sizes(tile_px: int, size: tuple[int, int]) -> None:
    _, model = _exported("lean_m")
    picture = _picture(*size)
    whole = _infer(NetworkEngine(model, threads=2), picture, _limits("lean_m", whole=True))
    for threads in (1, 2):
        engine = NetworkEngine(model, threads=threads)
        assert np.array_equal(_infer(engine, picture, _limits("lean_m", tile_px=tile_px)), whole)
