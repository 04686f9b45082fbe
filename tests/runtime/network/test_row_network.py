"""A network in strips of rows: the bits of the whole picture, whatever network and strip."""

from collections.abc import Sequence

import numpy as np
import onnx
import pytest
from onnx import helper

from camkit.arrays import FloatArray
from camkit.bundle.reader import find_bundle, open_bundle
from camkit.errors import ContractError
from camkit.runtime.cancel import Cancelled
from camkit.runtime.network import row_network
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.graph_cuts import cut_network
from camkit.runtime.network.row_network import NetworkRows, StripPlan, plan_strips
from camkit.runtime.rows import ArrayRows
from tests.bundle_factory import make_model, make_weight
from tests.network_graphs import GRAPHS
from tests.planes_bundle import finer_network

WIDTH_PX = 160
HEIGHT_PX = 320


def _shuffled(mode: str) -> bytes:
    """Build a network that is halved, filtered and put together again by DepthToSpace."""
    node = helper.make_node
    nodes = [
        node("SpaceToDepth", ["input"], ["half"], blocksize=2),
        node("Conv", ["half", "a"], ["first"], pads=[1] * 4),
        node("LeakyRelu", ["first"], ["active"], alpha=0.1),
        node("Conv", ["active", "b"], ["second"], pads=[1] * 4),
        node("Add", ["second", "active"], ["sum"]),
        node("Conv", ["sum", "c"], ["fine"], pads=[1] * 4),
        node("DepthToSpace", ["fine"], ["pixels"], blocksize=2, mode=mode),
        node("Conv", ["pixels", "d"], ["third"], pads=[1] * 4),
        node("Slice", ["input", "from", "to", "axis"], ["last"]),
        node("Add", ["third", "last"], ["output"]),
    ]
    weights = {
        "a": make_weight(16, 24, 3, 3),
        "b": make_weight(16, 16, 3, 3),
        "c": make_weight(64, 16, 3, 3),
        "d": make_weight(3, 16, 3, 3),
        "from": np.array([3]),
        "to": np.array([6]),
        "axis": np.array([1]),
    }
    return make_model(nodes, weights, channels=(6, 3)).SerializeToString()


def _shipped(name: str, size: str) -> bytes:
    bundle = open_bundle(find_bundle(name))
    return bundle.network_bytes(next(iter(bundle.manifest.networks)), size)


def _in_strips(engine: NetworkEngine, picture: FloatArray, strip_px: int) -> FloatArray:
    plan = _plan(engine, picture.shape[1:], strip_px)
    rows = NetworkRows(engine.segments(), ArrayRows(picture), plan)
    height, width = plan.height_px, plan.width_px
    result = np.empty((engine.outputs, engine.scale * height, engine.scale * width), np.float32)
    for top in range(0, height, 64):
        stop = min(top + 64, height)
        seen = np.empty((len(picture), stop - top, width), np.float32)
        rows.fill_inputs(seen, top)
        assert (seen[:, : len(picture[0]) - top] == picture[:, top:stop]).all()
        rows.fill_result(result[:, engine.scale * top : engine.scale * stop], top)
    return result


def _plan(engine: NetworkEngine, size_px: Sequence[int], strip_px: int) -> StripPlan:
    segments = [one.segment for one in engine.segments()]
    return plan_strips(segments, (size_px[0], size_px[1]), strip_px)


def _picture(channels: int, height_px: int = HEIGHT_PX) -> FloatArray:
    return np.random.default_rng(5).random((channels, height_px, WIDTH_PX), dtype=np.float32)


@pytest.mark.parametrize("strip_px", [16, 96, 1024])
@pytest.mark.parametrize(
    "data",
    [
        pytest.param(_shipped("duet", "S"), id="duet S"),
        pytest.param(_shipped("duet", "M"), id="duet M"),
        pytest.param(_shipped("thin-plate", "M"), id="thin-plate M"),
        pytest.param(_shuffled("CRD"), id="CRD"),
        pytest.param(_shuffled("DCR"), id="DCR"),
        pytest.param(finer_network(), id="finer"),
    ],
)
def test_strips_have_the_bits_of_the_whole_picture(data: bytes, strip_px: int) -> None:
    engine = NetworkEngine(data, threads=1, scale=inspect_graph(data).output_scale)
    picture = _picture(engine.channels)
    assert len(engine.segments()) > 0
    whole = engine.run(picture[None])[0]
    assert (_in_strips(engine, picture, strip_px) == whole).all()


@pytest.mark.parametrize("name", GRAPHS)
def test_networks_of_others_are_cut_where_the_whole_is_never_needed(name: str) -> None:
    data = GRAPHS[name]()
    facts = inspect_graph(data)
    engine = NetworkEngine(data, threads=1, scale=facts.output_scale)
    if facts.global_operators:
        assert engine.segments() == ()
        return
    picture = _picture(engine.channels, -(-96 // facts.stride_px) * facts.stride_px)
    whole = engine.run(picture[None])[0]
    strips = _in_strips(engine, picture, 32)
    if facts.unblocked_convolutions:  # their sums depend on the window, as in tiles
        assert np.abs(strips - whole).max() < 1e-4 * np.abs(whole).max()
    else:
        assert (strips == whole).all()


def test_every_node_is_in_one_segment_and_none_reaches_far() -> None:
    data = _shipped("duet", "M")
    segments = cut_network(data)
    nodes = [node.op_type for s in segments for node in onnx.load_from_string(s.model).graph.node]
    nodes += ["DepthToSpace" for s in segments for feed in s.feeds if feed.block > 1]
    whole = onnx.load_from_string(data).graph.node
    assert sorted(nodes) == sorted(node.op_type for node in whole if node.op_type != "Constant")
    assert max(s.reach_px for s in segments) < inspect_graph(data).receptive_field_radius_px / 2
    assert sum(s.mac_per_pixel for s in segments) == pytest.approx(
        inspect_graph(data).mac_per_pixel
    )


def test_parts_of_strips_have_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_network, "PART_BYTES", 1e6)
    engine = NetworkEngine(_shipped("duet", "M"), threads=1)
    picture = _picture(6)
    assert min(_plan(engine, picture.shape[1:], 96).columns) < WIDTH_PX // 2
    assert (_in_strips(engine, picture, 96) == engine.run(picture[None])[0]).all()


def test_a_picture_of_24_megapixels_is_computed_once_in_little_memory() -> None:
    engine = NetworkEngine(_shipped("duet", "M"), threads=1)
    plan = _plan(engine, (4000, 6000), 96)
    assert plan.work_ratio < 1.2
    assert plan.needed_bytes < 200e6
    assert _plan(engine, (4000, 6000), 16).needed_bytes < plan.needed_bytes


def test_a_cancelled_strip_ends() -> None:
    engine = NetworkEngine(_shipped("duet", "S"), threads=1)
    picture = _picture(6)
    plan = _plan(engine, picture.shape[1:], 96)
    rows = NetworkRows(engine.segments(), ArrayRows(picture), plan, lambda: True)
    with pytest.raises(Cancelled):
        rows.fill_result(np.empty((3, 96, WIDTH_PX), np.float32), 0)


def test_a_picture_larger_than_its_plan_is_refused() -> None:
    engine = NetworkEngine(_shipped("duet", "S"), threads=1)
    plan = _plan(engine, (64, 64), 32)
    with pytest.raises(ContractError, match="does not hold"):
        NetworkRows(engine.segments(), ArrayRows(_picture(6)), plan)
