"""Canonical graphs over large pictures: strips and windows have the bits of the whole."""

from functools import cache

import numpy as np
import onnx
import pytest

from camkit.export.foreign.canonical import canonical_graph
from camkit.export.foreign.global_statistics import with_constants, with_local_means
from camkit.export.foreign.onnx_file import foreign_model
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.row_network import NetworkRows, plan_strips
from camkit.runtime.network.tiling import TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows
from tests.foreign_networks import DnCNN, NAFNet, NormedUnet, Sid, exported, seeded

HEIGHT_PX, WIDTH_PX = 320, 160


@cache
def _graph(name: str) -> bytes:
    networks = {"dncnn": (DnCNN, 3), "sid": (Sid, 4), "naf": (NAFNet, 3), "unet": (NormedUnet, 3)}
    network, channels = networks[name.partition(" ")[0]]
    data = exported(seeded(network), "legacy", channels=channels, opset=17)
    graph = canonical_graph(foreign_model(onnx.load_from_string(data))).model
    if not inspect_graph(graph).global_operators:
        return graph
    if name.endswith("local"):
        return with_local_means(graph, 32)
    return with_constants(graph, [_picture(3)[None]])


def _picture(channels: int) -> np.ndarray:
    return np.random.default_rng(5).random((channels, HEIGHT_PX, WIDTH_PX), dtype=np.float32)


@pytest.mark.parametrize("name", ["dncnn", "sid", "naf", "unet", "naf local", "unet local"])
@pytest.mark.parametrize("strip_px", [16, 96])
def test_strips_and_windows_have_the_bits_of_the_whole(name: str, strip_px: int) -> None:
    data = _graph(name)
    facts = inspect_graph(data)
    assert not facts.unblocked_convolutions
    engine = NetworkEngine(data, threads=1, scale=facts.output_scale)
    picture = _picture(facts.input_channels)
    whole = engine.run(picture[None])[0]
    limits = TileLimits(
        stride_px=facts.stride_px, halo_px=facts.receptive_field_radius_px, tile_px=strip_px
    )
    bands = infer_bands(
        engine.run, ArrayRows(picture), lay_windows(HEIGHT_PX, WIDTH_PX, limits), scale=engine.scale
    )
    np.testing.assert_array_equal(np.concatenate(list(bands), axis=1), whole)
    segments = [one.segment for one in engine.segments()]
    assert segments
    plan = plan_strips(segments, (HEIGHT_PX, WIDTH_PX), strip_px)
    rows = NetworkRows(engine.segments(), ArrayRows(picture), plan)
    result = np.empty_like(whole)
    for top in range(0, HEIGHT_PX, 64):
        rows.fill_inputs(np.empty((len(picture), 64, WIDTH_PX), np.float32), top)
        rows.fill_result(result[:, engine.scale * top : engine.scale * (top + 64)], top)
    np.testing.assert_array_equal(result, whole)
