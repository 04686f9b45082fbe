"""Graphs are refused or understood; what is understood agrees with onnxruntime."""

import contextlib
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from camkit.bundle.facts import Port
from camkit.errors import BundleError
from camkit.runtime.machine.limits import NETWORK_WORK
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import check_graph, inspect_graph, parse_graph, with_node_outputs
from tests.bundle_factory import make_model, make_weight, tiny_facts, tiny_model, tiny_network
from tests.planes_bundle import facts_of, finer_model, finer_network

Mutation = Callable[[onnx.ModelProto], object]
NODE = helper.make_node


def _bytes(model: onnx.ModelProto) -> bytes:
    return model.SerializeToString()


def _chain(
    *steps: tuple[str, dict[str, object], tuple[NDArray[np.generic], ...]],
) -> onnx.ModelProto:
    """Chain operators from input to output, each with its constant operands."""
    names = ["input", *(f"t{i}" for i in range(1, len(steps))), "output"]
    nodes, weights = [], {}
    for (before, after), (op, attributes, operands) in zip(pairwise(names), steps, strict=True):
        extra = [f"{after}_{i}" for i in range(len(operands))]
        weights |= dict(zip(extra, operands, strict=True))
        nodes.append(NODE(op, [before, *extra], [after], name=f"{op}_{after}", **attributes))
    return make_model(nodes, weights, channels=(3, 3))


def _conv(
    kernel: int, **attributes: object
) -> tuple[str, dict[str, object], tuple[NDArray[np.generic]]]:
    attributes.setdefault("pads", [kernel // 2] * 4)
    return "Conv", attributes, (make_weight(3, 3, kernel, kernel),)


# ---------------------------------------------------------------------------- refusals


def _external(model: onnx.ModelProto) -> None:
    tensor = model.graph.initializer[0]
    tensor.data_location = TensorProto.EXTERNAL
    entry = tensor.external_data.add()
    entry.key, entry.value = "location", "../../etc/passwd"


def _external_in_constant(model: onnx.ModelProto) -> None:
    model.graph.node.insert(
        0, NODE("Constant", [], ["c"], value=helper.make_tensor("c", 1, [1], [0.0]))
    )
    tensor = model.graph.node[0].attribute[0].t
    tensor.data_location = TensorProto.EXTERNAL


def _body(model: onnx.ModelProto) -> None:
    inner = helper.make_graph([], "inner", [], [])
    model.graph.node.insert(0, NODE("If", ["input"], ["x"], then_branch=inner, else_branch=inner))


def _function(model: onnx.ModelProto) -> None:
    model.functions.append(
        helper.make_function("own", "f", ["x"], ["y"], [NODE("Relu", ["x"], ["y"])], [])
    )


def _sparse(model: onnx.ModelProto) -> None:
    model.graph.sparse_initializer.add()


def _set_type(model: onnx.ModelProto) -> None:
    model.graph.input[0].type.tensor_type.elem_type = TensorProto.DOUBLE


def _fix_height(model: onnx.ModelProto) -> None:
    model.graph.input[0].type.tensor_type.shape.dim[2].dim_value = 64


def _set_batch(model: onnx.ModelProto) -> None:
    model.graph.input[0].type.tensor_type.shape.dim[0].dim_value = 2


def _drop_axis(model: onnx.ModelProto) -> None:
    del model.graph.input[0].type.tensor_type.shape.dim[3]


def _nan(model: onnx.ModelProto) -> None:
    weight = np.full((8, 6, 4, 4), np.nan, np.float32)
    model.graph.initializer[0].raw_data = weight.tobytes()


def _complex(model: onnx.ModelProto) -> None:
    weight = numpy_helper.from_array(np.ones(1, np.complex64), "starts")
    model.graph.initializer[3].CopyFrom(weight)


def _huge(model: onnx.ModelProto) -> None:
    model.graph.initializer[0].dims[0] = 2**40


def _second_output(model: onnx.ModelProto) -> None:
    model.graph.output.append(
        helper.make_tensor_value_info("sum", TensorProto.FLOAT, [1, 8, "a", "b"])
    )


def _wrong_output_channels(model: onnx.ModelProto) -> None:
    model.graph.output[0].type.tensor_type.shape.dim[1].dim_value = 4


def _unsorted(model: onnx.ModelProto) -> None:
    first = model.graph.node.pop(0)
    model.graph.node.append(first)


REFUSALS: dict[str, tuple[Mutation, str]] = {
    "external data": (_external, "external data"),
    "external data in a constant": (_external_in_constant, "external data"),
    "foreign domain imported": (
        lambda m: m.opset_import.append(helper.make_opsetid("com.microsoft", 1)),
        "imports the domain 'com.microsoft'",
    ),
    "node of a foreign domain": (
        lambda m: setattr(m.graph.node[1], "domain", "com.microsoft"),
        "operator of domain",
    ),
    "operator off the list": (
        lambda m: setattr(m.graph.node[1], "op_type", "Einsum"),
        "Einsum is not on the list",
    ),
    "control flow": (_body, "has a body"),
    "function": (_function, "defines the function 'f'"),
    "training": (lambda m: m.training_info.add(), "training information"),
    "sparse": (_sparse, "sparse"),
    "old opset": (lambda m: setattr(m.opset_import[0], "version", 17), r"opset \[17\]"),
    "new opset": (lambda m: setattr(m.opset_import[0], "version", 21), r"opset \[21\]"),
    "new IR": (lambda m: setattr(m, "ir_version", 11), "IR 11"),
    "no opset": (lambda m: m.ClearField("opset_import"), "opset"),
    "double input": (_set_type, "must be float32; got DOUBLE"),
    "input of no known type": (
        lambda m: setattr(m.graph.input[0].type.tensor_type, "elem_type", 85),
        "type 85|not valid",
    ),
    "complex constant": (_complex, "complex64"),
    "fixed height": (_fix_height, "height and width open"),
    "batch of two": (_set_batch, "batch 1; got 2"),
    "three axes": (_drop_axis, "got 3 axes"),
    "NaN weight": (_nan, "NaN or inf"),
    "weight that is not there": (_huge, "declares .* values, it holds"),
    "second output": (_second_output, "one input and one output; got 1 and 2"),
    "wrong output channels": (_wrong_output_channels, "declares 4 channels"),
    "unsorted nodes": (_unsorted, "not valid"),
    "empty graph": (lambda m: m.ClearField("graph"), "no graph"),
}


@pytest.mark.parametrize(("mutate", "message"), REFUSALS.values(), ids=REFUSALS.keys())
def test_hostile_or_foreign_graph_is_refused(mutate: Mutation, message: str) -> None:
    model = tiny_model()
    mutate(model)
    with pytest.raises(BundleError, match=message):
        inspect_graph(_bytes(model))


@pytest.mark.parametrize("data", [b"", b"\x00", b"not an onnx" * 9, b"\xff" * 400])
def test_malformed_protobuf_is_a_bundle_error(data: bytes) -> None:
    with pytest.raises(BundleError):
        inspect_graph(data)


@settings(max_examples=150, deadline=None)
@given(position=st.integers(0, len(tiny_network()) - 1), value=st.integers(0, 255))
def test_a_changed_byte_is_understood_or_a_bundle_error(position: int, value: int) -> None:
    data = bytearray(tiny_network())
    data[position] = value
    with contextlib.suppress(BundleError):
        inspect_graph(bytes(data))


ONES = np.ones(3, np.float32)
UNFOLLOWED: dict[str, tuple[onnx.ModelProto, str]] = {
    "auto_pad": (
        _chain(("Conv", {"auto_pad": "SAME_UPPER"}, (make_weight(3, 3, 3, 3),))),
        "auto_pad",
    ),
    "ceil_mode": (
        _chain(("MaxPool", {"kernel_shape": [2, 2], "strides": [2, 2], "ceil_mode": 1}, ())),
        "ceil_mode",
    ),
    "valid convolution": (_chain(_conv(3, pads=[0] * 4)), "height and width of the input"),
    "output of half size": (_chain(_conv(3, strides=[2, 2])), "height and width of the input"),
    "weight of other channels": (
        _chain(("Conv", {"pads": [1] * 4}, (make_weight(3, 4, 3, 3),))),
        "does not fit 3 channels",
    ),
    "spatial constant": (
        _chain(("Add", {}, (np.ones((1, 3, 4, 4), np.float32),))),
        "varies over space",
    ),
    "Resize to a size": (
        _chain(
            ("Resize", {"mode": "nearest"}, (np.array([], np.float32), np.array([], np.float32)))
        ),
        "4 constant scales",
    ),
    "cubic Resize": (
        _chain(("Resize", {"mode": "cubic"}, (ONES[:0], np.array([1, 1, 2, 2], np.float32)))),
        "nearest and linear",
    ),
    "slice of rows": (
        _chain(("Slice", {}, tuple(np.array([v]) for v in (0, 8, 2)))),
        "along the channels only",
    ),
    "grid too coarse": (_chain(*[_conv(3, strides=[64, 64])] * 3), "sample every"),
}


@pytest.mark.parametrize(("model", "message"), UNFOLLOWED.values(), ids=UNFOLLOWED.keys())
def test_graph_whose_reach_cannot_be_told_is_refused(model: onnx.ModelProto, message: str) -> None:
    with pytest.raises(BundleError, match=message):
        inspect_graph(_bytes(model))


def _regrouped(op: str, operands: tuple[list[int], ...], **attributes: object) -> onnx.ModelProto:
    """Cut three of six channels out of the input and let them be the output."""
    constants = {f"c{i}": np.array(value, dtype=np.int64) for i, value in enumerate(operands)}
    outputs = ["output", "rest"] if op == "Split" else ["output"]
    return make_model([NODE(op, ["input", *constants], outputs, **attributes)], constants)


CUTS: dict[str, tuple[onnx.ModelProto, str | None]] = {
    "slice": (_regrouped("Slice", ([0], [6], [1], [2])), None),
    "slice from the end": (_regrouped("Slice", ([-3], [99], [-3])), None),
    "split in halves": (_regrouped("Split", (), axis=1, num_outputs=2), None),
    "split by sizes": (_regrouped("Split", ([3, 3],), axis=1), None),
    "slice of other size": (_regrouped("Slice", ([0], [2], [1])), "computes 2"),
    "empty slice": (_regrouped("Slice", ([4], [4], [1])), "empty"),
    "slice by 0": (_regrouped("Slice", ([0], [6], [1], [0])), "step 0"),
    "slice by fractions": (
        make_model(
            [NODE("Slice", ["input", "a", "b", "c"], ["output"])],
            {"a": np.zeros(1, np.int64), "b": np.array([3]), "c": np.ones(1, np.float32)},
        ),
        "must be integers|not valid",
    ),
    "split of rows": (_regrouped("Split", ([3, 3],), axis=2), "along the channels"),
    "split of other sizes": (_regrouped("Split", ([3, 4],), axis=1), "do not make 6"),
}


@pytest.mark.parametrize(("model", "message"), CUTS.values(), ids=CUTS.keys())
def test_channels_are_followed_through_cuts(model: onnx.ModelProto, message: str | None) -> None:
    if message is None:
        assert inspect_graph(_bytes(model)).output_channels == 3
        return
    with pytest.raises(BundleError, match=message):
        inspect_graph(_bytes(model))


def test_concat_adds_channels_and_keeps_the_longest_reach() -> None:
    nodes = [
        NODE("Conv", ["input", "a"], ["near"], pads=[1] * 4),
        NODE("Conv", ["input", "b"], ["far"], pads=[2] * 4),
        NODE("Concat", ["near", "far"], ["both"], axis=1),
        NODE("Conv", ["both", "c"], ["output"], pads=[0] * 4),
    ]
    weights = {
        "a": make_weight(2, 6, 3, 3),
        "b": make_weight(5, 6, 5, 5),
        "c": make_weight(3, 7, 1, 1),
    }
    assert inspect_graph(_bytes(make_model(nodes, weights))).receptive_field_radius_px == 2


OTHERS: dict[str, tuple[list[onnx.NodeProto], dict[str, NDArray[np.generic]], str]] = {
    "constants alone": (
        [NODE("Add", ["a", "a"], ["b"]), NODE("Add", ["input", "b"], ["output"])],
        {"a": np.ones((1, 3, 1, 1), np.float32)},
        "constants alone",
    ),
    "channels that do not go together": (
        [NODE("Add", ["input", "a"], ["output"])],
        {"a": np.ones((1, 4, 1, 1), np.float32)},
        "do not go together",
    ),
    "weight computed": (
        [NODE("Conv", ["input", "input"], ["output"])],
        {},
        "input 1 must be a constant",
    ),
    "shuffle of odd channels": (
        [NODE("DepthToSpace", ["input"], ["output"], blocksize=2)],
        {},
        "no 2x2 blocks",
    ),
    "shuffle by 0": (
        [NODE("DepthToSpace", ["input"], ["output"], blocksize=0)],
        {},
        "blocksize",
    ),
    "mean that drops axes": (
        [NODE("ReduceMean", ["input", "a"], ["output"], keepdims=0)],
        {"a": np.array([2, 3])},
        "keep dimensions|not valid",
    ),
    "output without space": (
        [NODE("GlobalMaxPool", ["input"], ["output"])],
        {},
        "height and width of the input",
    ),
    "pool with indices": (
        [NODE("MaxPool", ["input"], ["output", "index"], kernel_shape=[1, 1])],
        {},
        "indices",
    ),
    "one-dimensional kernel": (
        [NODE("MaxPool", ["input"], ["output"], kernel_shape=[1])],
        {},
        "must be 2-D",
    ),
    "negative pads": (
        [NODE("MaxPool", ["input"], ["output"], kernel_shape=[1, 1], pads=[-1] * 4)],
        {},
        "out of range",
    ),
    "Resize by an odd ratio": (
        [NODE("Resize", ["input", "", "a"], ["output"], mode="nearest")],
        {"a": np.array([1, 1, 0.1234567, 2], np.float32)},
        "plain ratio",
    ),
    "Resize for regions": (
        [
            NODE(
                "Resize",
                ["input", "", "a"],
                ["output"],
                coordinate_transformation_mode="half_pixel_symmetric",
            )
        ],
        {"a": np.array([1, 1, 2, 2], np.float32)},
        "coordinates",
    ),
    "output never computed": ([NODE("Relu", ["input"], ["x"])], {}, "never computed|not valid"),
}


@pytest.mark.parametrize(("nodes", "weights", "message"), OTHERS.values(), ids=OTHERS.keys())
def test_node_that_makes_no_sense_is_refused(
    nodes: list[onnx.NodeProto], weights: dict[str, NDArray[np.generic]], message: str
) -> None:
    with pytest.raises(BundleError, match=message):
        inspect_graph(_bytes(make_model(nodes, weights, channels=(3, 3))))


def test_ceiling_nearest_resize_reads_the_next_sample() -> None:
    way = {"coordinate_transformation_mode": "asymmetric", "nearest_mode": "ceil"}
    pool = ("MaxPool", {"kernel_shape": [2, 2], "strides": [2, 2]}, ())
    model = _chain(pool, ("Resize", {"mode": "nearest", **way}, (ONES[:0], SCALES)))
    assert inspect_graph(_bytes(model)).receptive_field_radius_px == _probe(model, 2, 32) == 2


def test_grids_that_do_not_meet_are_refused() -> None:
    nodes = [
        NODE("Conv", ["input", "w"], ["half"], strides=[2, 2], pads=[1, 1, 1, 1]),
        NODE("Add", ["input", "half"], ["output"]),
    ]
    model = make_model(nodes, {"w": make_weight(3, 3, 3, 3)}, channels=(3, 3))
    with pytest.raises(BundleError, match="different grids meet"):
        inspect_graph(_bytes(model))


# ---------------------------------------------------------------------------- manifest


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"inputs": (Port(name="planes", channels=5),)}, "input channels"),
        ({"outputs": (Port(name="clean", channels=4),)}, "output channels"),
        ({"outputs": (Port(name="clean", channels=3, scale=2),)}, "output scale"),
        ({"input_name": "x"}, "input name"),
        ({"output_name": "y"}, "output name"),
        ({"stride_px": 4}, "stride"),
        ({"global_operators": ("a (Softmax)",)}, "global operators"),
        ({"receptive_field_radius_px": 2, "receptive_field_probe_px": 2}, "reaches 3 px"),
        ({"bytes_per_pixel": 47.0}, "bytes_per_pixel is 48, the manifest says 47"),
    ],
)
def test_graph_that_contradicts_the_manifest_is_refused(
    change: dict[str, object], message: str
) -> None:
    with pytest.raises(BundleError, match=message):
        check_graph(tiny_network(), tiny_facts().model_copy(update=change))


def test_graph_that_agrees_with_the_manifest_is_admitted() -> None:
    found = check_graph(tiny_network(), tiny_facts())
    assert found.receptive_field_radius_px == 3
    assert found.unblocked_convolutions == ()
    assert found.global_operators == ()


def test_a_network_of_more_work_than_is_admitted_is_refused_unless_the_limit_is_raised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    work = inspect_graph(tiny_network()).work_per_pixel
    monkeypatch.setenv(NETWORK_WORK.variable, str(0.99 * work))
    with pytest.raises(BundleError, match=rf"network_m\.onnx takes .*{NETWORK_WORK.variable}="):
        check_graph(tiny_network(), tiny_facts())
    monkeypatch.setenv(NETWORK_WORK.variable, str(work))
    check_graph(tiny_network(), tiny_facts())


@pytest.mark.parametrize("name", [b"head", b"tail.weight", b"wiener", b"height", b"Conv"])
def test_a_name_that_is_no_utf_8_is_refused(name: bytes) -> None:
    data = tiny_network().replace(name, b"\xff\xfe" + name[2:])
    assert data != tiny_network()
    with pytest.raises(BundleError, match=r"text in it \(.*\) is no UTF-8"):
        inspect_graph(data)


def _with_third_input(name: str, weights: dict[str, NDArray[np.generic]]) -> bytes:
    nodes = [NODE("Conv", ["input", "w", name], ["output"], "conv")]
    return _bytes(make_model(nodes, {"w": make_weight(3, 6, 1, 1)} | weights))


def test_a_bias_is_constant_and_has_a_number_for_every_channel() -> None:
    inspect_graph(_with_third_input("bias", {"bias": np.ones(3, np.float32)}))
    with pytest.raises(BundleError, match="conv: input 2 must be a constant"):
        inspect_graph(_with_third_input("input", {}))
    with pytest.raises(BundleError, match="a bias has one number for each of 3 channels"):
        inspect_graph(_with_third_input("bias", {"bias": np.ones(4, np.float32)}))


ABSURD: dict[str, tuple[onnx.ModelProto, str]] = {
    "inputs without end": (
        _chain(_conv(1), ("Max", {}, (np.zeros((3, 1, 1), np.float32),) * 300)),
        "more than 256 inputs",
    ),
    "a rim without end": (
        _chain(_conv(1, pads=[200] * 4), _conv(401, pads=[0] * 4)),
        "pads the picture by more than 64 px",
    ),
    "numbers of 8 bytes": (
        _chain(("Cast", {"to": TensorProto.DOUBLE}, ()), ("Cast", {"to": TensorProto.FLOAT}, ())),
        "casts to float32 and float16 alone",
    ),
    "channels without end": (
        make_model(
            [
                NODE("Concat", ["input"] * 256, ["a"], "a", axis=1),
                NODE("Concat", ["a"] * 256, ["output"], "b", axis=1),
            ],
            {},
        ),
        "b: gives 393216 channels; at most 65536",
    ),
}


@pytest.mark.parametrize(("model", "message"), ABSURD.values(), ids=ABSURD.keys())
def test_tensors_that_would_be_absurdly_large_are_refused(
    model: onnx.ModelProto, message: str
) -> None:
    with pytest.raises(BundleError, match=message):
        inspect_graph(_bytes(model))


# ---------------------------------------------------------------------------- facts


def test_pooling_counts_as_work_and_not_as_multiplications() -> None:
    pool = ("AveragePool", {"kernel_shape": [9, 9], "pads": [4] * 4}, ())
    found = inspect_graph(_bytes(_chain(_conv(1), pool)))
    assert found.mac_per_pixel == 9
    # read and written: 3 channels before, between and behind, the middle twice
    assert found.work_per_pixel == 9 + 16 * 81 * 3 + (3 + 3 + 3) + (3 + 3)
    assert found.values_per_pixel == 9


def test_the_room_that_a_transposed_convolution_needs_counts_as_memory() -> None:
    weight = make_weight(3, 3, 15, 15)
    found = inspect_graph(_bytes(_chain(_conv(1), ("ConvTranspose", {"pads": [7] * 4}, (weight,)))))
    assert found.bytes_per_pixel == 4 * (3 + 3 + 3 * 15 * 15)


def test_a_convolution_off_the_blocked_path_needs_its_input_twice() -> None:
    nodes = [
        NODE("Conv", ["input", "a"], ["x"], "a", pads=[1] * 4),
        NODE("Conv", ["x", "b"], ["output"], "b", pads=[1] * 4),
    ]
    weights = {"a": make_weight(50, 6, 3, 3), "b": make_weight(3, 50, 3, 3)}
    assert inspect_graph(_bytes(make_model(nodes, weights))).bytes_per_pixel == 4 * (50 + 50 + 3)


def test_cost_of_the_tiny_network_is_the_sum_by_hand() -> None:
    found = inspect_graph(tiny_network())
    head, body, tail = 6 * 8 * 16, 8 * 8 * 9, 8 * 12
    assert found.mac_per_pixel == (head + body + tail) / 4
    assert found.parameters == head + body + tail
    # At "sum": input 6, active 8/4, body 8/4 written over by the sum. At "head": 6 + 8/4.
    # At the residual: fine 3, input's Wiener planes 3. Largest while Slice copies: 6 + 3 + 3.
    assert found.bytes_per_pixel == 4 * (6 + 3 + 3)


def test_transposed_convolution_costs_by_its_input_and_is_marked() -> None:
    up = ("ConvTranspose", {"strides": [2, 2]}, (make_weight(3, 3, 2, 2),))
    found = inspect_graph(_bytes(_chain(_conv(3, strides=[2, 2]), up)))
    assert found.mac_per_pixel == (81 + 36) / 4
    assert found.unblocked_convolutions == ("ConvTranspose_output",)


@pytest.mark.parametrize(
    ("channels", "groups", "blocked"),
    [
        (3, 1, True),
        (7, 1, True),
        (9, 1, False),
        (12, 1, True),
        (30, 1, False),
        (32, 32, True),
        (8, 2, False),
    ],
)
def test_convolutions_off_the_blocked_path_are_named(
    channels: int, groups: int, blocked: bool
) -> None:
    weight = make_weight(channels, channels // groups, 3, 3)
    node = NODE("Conv", ["input", "w"], ["output"], "conv", pads=[1] * 4, group=groups)
    model = make_model([node], {"w": weight}, channels=(channels, channels))
    assert inspect_graph(_bytes(model)).unblocked_convolutions == (() if blocked else ("conv",))


SCALES = np.array([1, 1, 2, 2], np.float32)
GLOBALS: dict[str, tuple[onnx.ModelProto, str]] = {
    "instance normalisation": (_chain(("InstanceNormalization", {}, (ONES, ONES))), "InstanceNorm"),
    "softmax over columns": (_chain(("Softmax", {"axis": 3}, ())), "Softmax"),
    "aligned corners": (
        _chain(
            _conv(3, strides=[2, 2]),
            (
                "Resize",
                {"mode": "linear", "coordinate_transformation_mode": "align_corners"},
                (ONES[:0], SCALES),
            ),
        ),
        "Resize",
    ),
}


@pytest.mark.parametrize(("model", "name"), GLOBALS.values(), ids=GLOBALS.keys())
def test_operators_that_see_the_whole_picture_are_found(model: onnx.ModelProto, name: str) -> None:
    (found,) = inspect_graph(_bytes(model)).global_operators
    assert name in found


@pytest.mark.parametrize("op", ["GlobalAveragePool", "ReduceMean"])
def test_spatial_mean_that_feeds_a_gate_is_found(op: str) -> None:
    extra = ["axes"] if op == "ReduceMean" else []
    nodes = [
        NODE(op, ["input", *extra], ["mean"], "mean"),
        NODE("Mul", ["input", "mean"], ["output"]),
    ]
    model = make_model(nodes, {"axes": np.array([2, 3])} if extra else {}, channels=(3, 3))
    assert inspect_graph(_bytes(model)).global_operators == (f"mean ({op})",)


def test_softmax_and_mean_over_channels_are_local() -> None:
    nodes = [
        NODE("Softmax", ["input"], ["soft"], axis=1),
        NODE("ReduceMean", ["soft", "axes"], ["mean"]),
        NODE("Sub", ["soft", "mean"], ["output"]),
    ]
    model = make_model(nodes, {"axes": np.array([1])}, channels=(3, 3))
    found = inspect_graph(_bytes(model))
    assert found.global_operators == ()
    assert found.receptive_field_radius_px == 0


# ---------------------------------------------------------------------------- against the probe


def _probe(model: onnx.ModelProto, stride: int, side: int) -> int:
    """Measure the reach on the lattice: change one pixel after another, see what changes."""
    engine = NetworkEngine(_bytes(model), threads=1)
    base = np.random.default_rng(1).uniform(1, 2, (1, engine.channels, side, side))
    base = base.astype(np.float32)
    still = engine.run(base)
    reach, middle = 0, side // 2 // stride * stride
    for offset in range(stride):
        changed = base.copy()
        changed[0, :, middle + offset, middle + offset] += 10
        moved = np.argwhere((engine.run(changed) != still).any(axis=(0, 1)))
        for index in moved.ravel():
            tile = index // stride * stride
            pixel = middle + offset
            reach = max(reach, tile - pixel, pixel - (tile + stride - 1))
    return reach


UP = ("ConvTranspose", {"strides": [2, 2]}, (make_weight(3, 3, 2, 2),))
WIDE_UP = ("ConvTranspose", {"strides": [2, 2], "pads": [1] * 4}, (make_weight(3, 3, 4, 4),))
SHUFFLE = ("DepthToSpace", {"blocksize": 2}, ())
WIDEN = ("Conv", {}, (make_weight(12, 3, 1, 1),))


def _resize(
    mode: str, **attributes: object
) -> tuple[str, dict[str, object], Sequence[NDArray[np.generic]]]:
    return "Resize", {"mode": mode, **attributes}, (ONES[:0], SCALES)


KNOWN: dict[str, tuple[onnx.ModelProto, int, int]] = {
    "one 5x5": (_chain(_conv(5)), 1, 2),
    "dilated 3x3": (_chain(_conv(3, dilations=[3, 3], pads=[3] * 4)), 1, 3),
    "down and up by transposed 2x2": (_chain(_conv(3, strides=[2, 2]), UP), 2, 1),
    "down and up by transposed 4x4": (_chain(_conv(3, strides=[2, 2]), WIDE_UP), 2, 3),
    "down, 3x3, shuffled up": (_chain(_conv(3, strides=[2, 2]), _conv(3), WIDEN, SHUFFLE), 2, 3),
    "unshuffle, 3x3, shuffle": (
        _chain(
            ("SpaceToDepth", {"blocksize": 2}, ()),
            ("Conv", {"pads": [1] * 4}, (make_weight(12, 12, 3, 3),)),
            SHUFFLE,
        ),
        2,
        2,
    ),
    "max pool and nearest": (
        _chain(
            ("MaxPool", {"kernel_shape": [2, 2], "strides": [2, 2]}, ()),
            _conv(3),
            _resize("nearest", coordinate_transformation_mode="asymmetric", nearest_mode="floor"),
        ),
        2,
        2,
    ),
    "average pool and bilinear": (
        _chain(("AveragePool", {"kernel_shape": [2, 2], "strides": [2, 2]}, ()), _resize("linear")),
        2,
        2,
    ),
}


@pytest.mark.parametrize(("model", "stride", "reach"), KNOWN.values(), ids=KNOWN.keys())
def test_reach_by_walk_equals_reach_by_hand_and_by_probe(
    model: onnx.ModelProto, stride: int, reach: int
) -> None:
    found = inspect_graph(_bytes(model))
    assert found.stride_px == stride
    assert found.receptive_field_radius_px == reach
    assert _probe(model, stride, 32) == reach


def test_reach_of_the_tiny_network_equals_the_probe() -> None:
    assert (
        _probe(tiny_model(), 2, 32) == inspect_graph(tiny_network()).receptive_field_radius_px == 3
    )


STEPS = st.tuples(
    st.sampled_from([1, 3, 5]),
    st.integers(1, 2),
    st.sampled_from(["up", "wide", "shuffle", "linear"]),
)


@settings(max_examples=20, deadline=None)
@given(levels=st.lists(STEPS, min_size=1, max_size=2), middle=st.sampled_from([1, 3]))
def test_walk_never_reaches_less_than_the_probe(
    levels: list[tuple[int, int, str]], middle: int
) -> None:
    down, up = [], []
    for kernel, dilation, way in levels:
        pads = [dilation * (kernel // 2)] * 4
        down.append(_conv(kernel, dilations=[dilation] * 2, pads=pads))
        down.append(("MaxPool", {"kernel_shape": [2, 2], "strides": [2, 2]}, ()))
        ways = {
            "up": [UP],
            "wide": [WIDE_UP],
            "shuffle": [WIDEN, SHUFFLE],
            "linear": [_resize("linear")],
        }
        up = [*ways[way], *up]
    model = _chain(*down, _conv(middle), *up)
    found = inspect_graph(_bytes(model))
    assert found.stride_px == 2 ** len(levels)
    assert _probe(model, found.stride_px, 64) <= found.receptive_field_radius_px


# ---------------------------------------------------------------------------- finer outputs


def _finer_probe(model: onnx.ModelProto, stride: int, side: int, scale: int) -> int:
    """Measure the reach on the lattice of a network with `scale` samples along a pixel's side."""
    engine = NetworkEngine(_bytes(model), threads=1, scale=scale)
    base = np.random.default_rng(1).uniform(1, 2, (1, engine.channels, side, side))
    base = base.astype(np.float32)
    still = engine.run(base)
    reach, middle = 0, side // 2 // stride * stride
    for offset in range(stride):
        changed = base.copy()
        changed[0, :, middle + offset, middle + offset] += 10
        moved = np.argwhere((engine.run(changed) != still).any(axis=(0, 1))) // scale
        for index in moved.ravel():
            tile, pixel = index // stride * stride, middle + offset
            reach = max(reach, tile - pixel, pixel - (tile + stride - 1))
    return reach


THICK = ("Conv", {}, (make_weight(27, 3, 1, 1),))
TRIPLE = ("DepthToSpace", {"blocksize": 3}, ())
FINER: dict[str, tuple[onnx.ModelProto, int, int, int]] = {
    # model, stride, scale, reach
    "3x3 then shuffled": (_chain(_conv(3), WIDEN, SHUFFLE), 1, 2, 1),
    "shuffled then 3x3": (_chain(WIDEN, SHUFFLE, _conv(3)), 1, 2, 1),
    "shuffled then 5x5": (_chain(WIDEN, SHUFFLE, _conv(5)), 1, 2, 1),
    "shuffled then 7x7": (_chain(WIDEN, SHUFFLE, _conv(7)), 1, 2, 2),
    "three times as fine, 3x3": (_chain(THICK, TRIPLE, _conv(3)), 1, 3, 1),
    "transposed 2x2": (_chain(UP), 1, 2, 0),
    "transposed 4x4": (_chain(WIDE_UP), 1, 2, 1),
    "nearest resize": (
        _chain(
            _resize("nearest", coordinate_transformation_mode="asymmetric", nearest_mode="floor")
        ),
        1,
        2,
        0,
    ),
    "bilinear resize": (_chain(_resize("linear")), 1, 2, 1),
    "down once and up twice": (
        _chain(_conv(3, strides=[2, 2]), WIDEN, SHUFFLE, WIDEN, SHUFFLE),
        2,
        2,
        1,
    ),
    "of the tests": (finer_model(3, 3, scale=2), 2, 2, 3),
    "of the tests, three times": (finer_model(3, 3, scale=3), 2, 3, 3),
}


@pytest.mark.parametrize(("model", "stride", "scale", "reach"), FINER.values(), ids=FINER.keys())
def test_reach_and_scale_of_finer_outputs_are_those_by_hand_and_by_probe(
    model: onnx.ModelProto, stride: int, scale: int, reach: int
) -> None:
    found = inspect_graph(_bytes(model))
    assert (found.stride_px, found.output_scale) == (stride, scale)
    assert found.receptive_field_radius_px == reach
    assert _finer_probe(model, stride, 32, scale) == reach


def test_costs_of_a_finer_network_are_counted_per_pixel_of_its_input() -> None:
    model = _chain(_conv(3), WIDEN, SHUFFLE, _conv(3))
    found = inspect_graph(_bytes(model))
    assert found.mac_per_pixel == 81 + 36 + 4 * 81
    # At the last convolution: 3 channels in and 3 out, on four samples for each pixel.
    assert found.bytes_per_pixel == 4 * (12 + 12)


def test_sides_that_grow_unlike_each_other_are_refused() -> None:
    scales = np.array([1, 1, 2, 3], np.float32)
    resize = ("Resize", {"mode": "nearest"}, (ONES[:0], scales))
    with pytest.raises(BundleError, match="both multiplied by one whole number"):
        inspect_graph(_bytes(_chain(resize)))


def test_a_finer_graph_is_held_against_what_the_manifest_says() -> None:
    data = finer_network(4, 3, scale=2)
    inputs = [Port(name="a", channels=1), Port(name="b", channels=3)]
    outputs = [Port(name="near", channels=1, scale=2), Port(name="far", channels=2, scale=2)]
    facts = facts_of(data, inputs, outputs)
    assert check_graph(data, facts).output_scale == facts.output_scale == 2
    coarse = tuple(port.model_copy(update={"scale": 3}) for port in outputs)
    with pytest.raises(BundleError, match="output scale of the graph is 2, the manifest says 3"):
        check_graph(data, facts.model_copy(update={"outputs": coarse}))


# ---------------------------------------------------------------------------- other outputs


def test_every_tensor_becomes_an_output() -> None:
    data, names = with_node_outputs(tiny_network())
    model = onnx.ModelProto.FromString(data)
    assert [value.name for value in model.graph.output] == list(names)
    assert {"head", "active", "output"} <= set(names)


def test_constants_in_nodes_are_understood() -> None:
    one = helper.make_tensor("one", TensorProto.FLOAT, [1], [1.0])
    nodes = [
        NODE("Constant", [], ["a"], value=one),
        NODE("Constant", [], ["b"], value_float=2.0),
        NODE("Mul", ["input", "a"], ["x"]),
        NODE("Add", ["x", "b"], ["output"]),
    ]
    graph = parse_graph(_bytes(make_model(nodes, {}, channels=(3, 3))))
    assert [node.op for node in graph.nodes] == ["Mul", "Add"]
    assert graph.constants["b"] == 2.0


def test_constant_that_is_no_number_is_refused() -> None:
    nodes = [NODE("Constant", [], ["a"], value_string="x"), NODE("Relu", ["input"], ["output"])]
    with pytest.raises(BundleError, match="constants of numbers"):
        parse_graph(_bytes(make_model(nodes, {}, channels=(3, 3))))


# ---------------------------------------------------------------------------- curves and pads


def _pad(mode: str, pads: list[int]) -> tuple[str, dict[str, object], tuple[np.ndarray, ...]]:
    return ("Pad", {"mode": mode}, (np.array(pads, np.int64),))


@pytest.mark.parametrize("mode", ["reflect", "edge", "constant"])
def test_a_pad_reaches_as_the_convolution_behind_it(mode: str) -> None:
    pads = [0, 0, 2, 2, 0, 0, 2, 2]
    found = inspect_graph(_bytes(_chain(_pad(mode, pads), _conv(5, pads=[0] * 4))))
    assert found.receptive_field_radius_px == 2
    assert not found.global_operators


@pytest.mark.parametrize(
    ("mode", "pads", "message"),
    [
        ("wrap", [0, 0, 1, 1, 0, 0, 1, 1], "mode 'wrap'"),
        ("edge", [0, 1, 1, 1, 0, 0, 1, 1], "rows and columns only"),
        ("reflect", [0, 0, -1, 1, 0, 0, 1, 1], "out of range"),
    ],
)
def test_a_pad_that_cannot_be_followed_is_refused(mode: str, pads: list[int], message: str) -> None:
    with pytest.raises(BundleError, match=message):
        inspect_graph(_bytes(_chain(_pad(mode, pads), _conv(3, pads=[0] * 4))))


def _choice(*, misused: bool = False) -> bytes:
    """Build x where it is above a half, else its square root; the truth alone if misused."""
    nodes = [
        NODE("Greater", ["input", "half"], ["is_bright"], "is_bright"),
        NODE("Pow", ["input", "half"], ["root"], "root"),
        NODE("Where", ["is_bright", "input", "root"], ["output"], "where"),
    ]
    if misused:
        nodes[1] = NODE("Abs", ["is_bright"], ["root"], "root")
    return _bytes(make_model(nodes, {"half": np.full(1, 0.5, np.float32)}, channels=(3, 3)))


def test_a_choice_by_a_comparison_is_pointwise() -> None:
    found = inspect_graph(_choice())
    assert found.receptive_field_radius_px == 0
    names = with_node_outputs(_choice())[1]
    assert names == ("root", "output")  # truth has no range


def test_the_truth_of_a_comparison_is_taken_by_a_choice_alone() -> None:
    with pytest.raises(BundleError, match="first input of a Where, nothing else"):
        inspect_graph(_choice(misused=True))
