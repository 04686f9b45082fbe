"""What onnxruntime computes at less cost is the same network: its numbers, its reach, its bits."""

import numpy as np
import onnx
import pytest
from onnx import helper

from camkit.export import folding
from camkit.export.folding import fold_nodes
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph, parse_graph
from camkit.runtime.network.probe import perturbation_reach
from camkit.runtime.network.tiling import TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows
from tests.bundle_factory import make_model

NODE = helper.make_node
NEAREST = {
    "mode": "nearest",
    "coordinate_transformation_mode": "asymmetric",
    "nearest_mode": "floor",
}
TOLERANCE = 2e-6


def _weights(channels=8, outputs=3):
    rng = np.random.default_rng(4)
    shapes = {
        "head": (channels, 6, 3, 3),
        "down": (channels, channels, 4, 4),
        "deep": (channels, channels, 4, 4),
        "up": (channels, channels, 3, 3),
        "wide": (channels, 2 * channels, 3, 3),
        "tail": (outputs, channels, 3, 3),
    }
    made = {n: (rng.standard_normal(s) / np.sqrt(np.prod(s[1:]))) for n, s in shapes.items()}
    made |= {f"{n}_bias": rng.standard_normal(s[0]) / 5 for n, s in shapes.items()}
    made |= {"slope": np.full((1, 1, 1, 1), 0.2), "mean": rng.standard_normal((channels, 1, 1))}
    made |= {"scale": rng.uniform(0.5, 2, (channels, 1, 1)), "scales": np.array([1, 1, 2, 2])}
    return {name: np.asarray(values, np.float32) for name, values in made.items()}


def _conv(source, name, target, side=3, stride=1):
    pads = [(side - stride + 1) // 2] * 4
    inputs = [source, name, f"{name}_bias"]
    return NODE("Conv", inputs, [target], target, strides=[stride] * 2, pads=pads)


def _generator(weights, **resize):
    """Build two scales with everything that is folded, as the generator of chapter 3 has it."""
    nodes = [
        _conv("input", "head", "a"),
        NODE("PRelu", ["a", "slope"], ["b"]),
        _conv("b", "down", "c", 4, 2),
        NODE("PRelu", ["c", "slope"], ["d"]),
        _conv("d", "deep", "e", 4, 2),
        NODE("Sub", ["e", "mean"], ["f"]),
        NODE("Mul", ["f", "scale"], ["g"]),
        NODE("PRelu", ["g", "slope"], ["h"]),
        NODE("Resize", ["h", "", "scales"], ["i"], **(NEAREST | resize)),
        _conv("i", "up", "j"),
        NODE("Concat", ["j", "c"], ["k"], axis=1),
        NODE("Resize", ["k", "", "scales"], ["l"], **(NEAREST | resize)),
        _conv("l", "wide", "m"),
        NODE("PRelu", ["m", "slope"], ["n"]),
        _conv("n", "tail", "output"),
    ]
    return make_model(nodes, weights, channels=(6, len(weights["tail"])))


def _folded(model):
    changed = onnx.ModelProto.FromString(model.SerializeToString())
    fold_nodes(changed.graph)
    onnx.checker.check_model(changed, full_check=True)
    return changed.SerializeToString()


def _operators(data):
    return [node.op for node in parse_graph(data).nodes]


@pytest.mark.parametrize("outputs", [2, 3])
def test_numbers_and_reach_stay_while_work_and_memory_shrink(outputs):
    model = _generator(_weights(outputs=outputs))
    before, after = model.SerializeToString(), _folded(model)
    assert not {"PRelu", "Resize", "Sub", "Mul"} & set(_operators(after))
    # The picture of few channels is made on the coarse grid: 2 fit four times into 8, 3 do not.
    assert _operators(after).count("Add") == (3 if outputs == 2 else 0)
    planes = np.random.default_rng(1).random((1, 6, 48, 36), dtype=np.float32)
    results = [NetworkEngine(data, threads=1).run(planes) for data in (before, after)]
    assert np.abs(results[0] - results[1]).max() < TOLERANCE * np.abs(results[0]).max()
    old, new = inspect_graph(before), inspect_graph(after)
    assert new.receptive_field_radius_px == old.receptive_field_radius_px
    assert new.stride_px == old.stride_px == 4
    assert new.mac_per_pixel < 0.75 * old.mac_per_pixel
    assert new.bytes_per_pixel < old.bytes_per_pixel
    assert new.unblocked_convolutions == ()


def test_the_walk_through_places_of_blocks_is_what_a_kick_shows():
    data = _folded(_generator(_weights()))
    facts, engine = inspect_graph(data), NetworkEngine(data, threads=1)
    found = perturbation_reach(
        engine.run, 64, np.random.default_rng(0), stride_px=facts.stride_px, channels=6
    )
    assert found.halo_px <= facts.receptive_field_radius_px <= found.halo_px + facts.stride_px


@pytest.mark.parametrize("tile_px", [4, 12, 20])
def test_tiled_equals_whole_bit_for_bit(tile_px):
    data = _folded(_generator(_weights(channels=16)))
    facts, engine = inspect_graph(data), NetworkEngine(data, threads=1)
    picture = np.random.default_rng(2).random((6, 61, 83), dtype=np.float32)
    results = []
    for tile in (tile_px, None):
        limits = TileLimits(
            stride_px=facts.stride_px,
            halo_px=facts.receptive_field_radius_px,
            max_bytes=2**40,
            tile_px=tile,
        )
        layout = lay_windows(61, 83, limits)
        results.append(np.concatenate([*infer_bands(engine.run, ArrayRows(picture), layout)], 1))
    assert np.array_equal(*results)


def test_what_is_no_such_pattern_stays():
    weights = _weights() | {"slope": np.full((8, 1, 1), 0.2, np.float32)}
    weights |= {"mean": np.zeros((1, 1, 1), np.float32), "scale": np.ones((1, 1, 1), np.float32)}
    model = _generator(weights, mode="linear")
    assert _operators(_folded(model)) == _operators(model.SerializeToString())


def test_a_picture_that_others_read_is_still_doubled():
    nodes = [
        NODE("Resize", ["input", "", "scales"], ["fine"], **NEAREST),
        NODE("Conv", ["fine", "kernel"], ["seen"], pads=[1] * 4),
        NODE("Add", ["fine", "seen"], ["output"]),
    ]
    weights = {"scales": _weights()["scales"], "kernel": np.ones((6, 6, 3, 3), np.float32)}
    graph = make_model(nodes, weights, channels=(6, 6)).graph
    fold_nodes(graph)
    assert [node.op_type for node in graph.node] == ["Resize", "Conv", "Add"]


def test_kernels_of_too_many_numbers_stay(monkeypatch):
    model = _generator(_weights())
    monkeypatch.setattr(folding, "MOST_WEIGHTS", 8 * 8 * 9)
    assert _operators(_folded(model)).count("Resize") == 1
