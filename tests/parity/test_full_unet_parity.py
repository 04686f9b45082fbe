"""The generator of fine-tuning: torch = onnxruntime, tiled = whole, as far as it reaches."""

import numpy as np
import pytest
import torch
from torch import nn

from camkit.export.onnx_graph import to_onnx
from camkit.models_def.networks.full_unet import FullConfig, FullUnet
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.tiling import TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows

REACH_PX = 446


@pytest.fixture(scope="module")
def exported() -> bytes:
    """A narrow generator whose deep scales do something."""
    torch.manual_seed(6)
    network = FullUnet(FullConfig(widths=(4, 4, 4, 4, 4, 4, 4)))
    nn.init.normal_(network.deep.join.weight, std=0.2)
    return to_onnx(network.eval())


def test_reach_and_stride_are_those_stated_and_nothing_is_global(exported: bytes) -> None:
    facts = inspect_graph(exported)
    assert (facts.receptive_field_radius_px, facts.stride_px) == (REACH_PX, 64)
    assert facts.global_operators == ()


def test_tiled_equals_whole_bit_for_bit(exported: bytes) -> None:
    rng = np.random.default_rng(1)
    picture = rng.random((6, 60, 1600), dtype=np.float32)
    engine = NetworkEngine(exported, threads=1)
    results = []
    for tile_px in (64, None):
        limits = TileLimits(stride_px=64, halo_px=REACH_PX, max_bytes=2**40, tile_px=tile_px)
        layout = lay_windows(60, 1600, limits)
        assert (layout.window_count > 1) == (tile_px is not None)
        results.append(np.concatenate([*infer_bands(engine.run, ArrayRows(picture), layout)], 1))
    assert np.array_equal(*results)
