"""Nodes of a traced network in the form that onnxruntime computes at the least cost.

    Conv, - constant, * constant         Conv with other weights and bias
    PRelu with one slope                 LeakyRelu, which joins the convolution before it
    Resize x2 (nearest), Conv 3x3        four Conv 2x2 on the coarse grid, DepthToSpace
    the same, then Conv 3x3 to few       the same, four more Conv 2x2, their sum, DepthToSpace

Each gives the numbers of what it replaces up to rounding, and bits that do not depend on the window
if those did not. Of nine products of a pixel on a doubled picture four are left, since the nine see
four different samples; and the doubled picture of all channels, which would be held twice while it
is put in blocks, is not made where few channels are left of it.
"""

from collections.abc import Iterable, Iterator
from itertools import product
from typing import Any, Final

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import helper, numpy_helper

from camkit.models_def.training.first_weights import PRELU

Weights = dict[str, NDArray[Any]]
_TAPS: Final = (((0,), (1, 2)), ((0, 1), (2,)))
"""Of a 3x3 kernel on a doubled picture, by the parity of a pixel: the taps that see one sample."""
_SCALES: Final = (1, 1, 2, 2)
MOST_WEIGHTS: Final = 2**22
"""Larger kernels stay as they are: on the coarse grid they are 16/9 as many numbers, which a
process holds twice, and such kernels belong to coarse scales, where little is to be saved."""


def fold_nodes(graph: onnx.GraphProto) -> None:
    """Rewrite the nodes of a graph, in place; other patterns stay as they are."""
    weights = {w.name: numpy_helper.to_array(w) for w in graph.initializer}
    initial_names = set(weights)
    nodes = list(graph.node)
    for fold in (_constants_into_weights, _one_slope, _coarse_convolutions):
        nodes = fold(nodes, weights, str(graph.output[0].name))
    del graph.node[:]
    graph.node.extend(nodes)
    input_names = {name for node in nodes for name in node.input}
    initializers = [w for w in graph.initializer if w.name in input_names]
    new_initializers = [
        numpy_helper.from_array(w, n)
        for n, w in weights.items()
        if n in input_names - initial_names
    ]
    del graph.initializer[:]
    graph.initializer.extend([*initializers, *new_initializers])


def _constants_into_weights(nodes: list[Any], weights: Weights, last: str) -> list[Any]:
    """Fold channel constants behind a convolution into its weights and its bias."""
    nodes, place = list(nodes), 0
    while place < len(nodes):
        conv = nodes[place]
        follower = _only_reader(nodes, conv, last) if _has_bias(conv, weights) else None
        constant = None if follower is None else _channel_constant(follower, conv, weights)
        if follower is None or constant is None:
            place += 1
            continue
        weight, bias = (weights[name].astype(np.float64) for name in conv.input[1:3])
        if follower.op_type == "Sub":
            bias = bias - constant
        else:
            weight, bias = weight * constant[:, None, None, None], bias * constant
        names = [f"{follower.output[0]}_{what}" for what in ("weight", "bias")]
        for name, values in zip(names, (weight, bias), strict=True):
            weights[name] = values.astype(np.float32)
        nodes[place] = _copied(conv, [conv.input[0], *names], follower.output[0])
        nodes.remove(follower)
    return nodes


def _has_bias(node: Any, weights: Weights) -> bool:
    constants = list(node.input[1:])
    return node.op_type == "Conv" and len(constants) == 2 and all(c in weights for c in constants)


def _channel_constant(node: Any, conv: Any, weights: Weights) -> NDArray[Any] | None:
    """Return the (channel,) numbers that a node takes from, or multiplies with, its first input."""
    if node.op_type not in ("Sub", "Mul") or node.input[0] != conv.output[0]:
        return None
    values, channels = weights.get(node.input[1]), weights[conv.input[1]].shape[0]
    if values is None or values.shape[-3:] != (channels, 1, 1) or values.size != channels:
        return None
    return values.reshape(channels).astype(np.float64)


def _one_slope(nodes: list[Any], weights: Weights, _last: str) -> list[Any]:
    """Store a slope that all channels share as an attribute."""

    def changed(node: Any) -> Any:
        slope = weights.get(node.input[1]) if node.op_type == "PRelu" else None
        if slope is None or slope.size != 1:
            return node
        return helper.make_node(
            "LeakyRelu",
            [node.input[0]],
            [node.output[0]],
            node.output[0] + PRELU,
            alpha=float(slope.item()),
        )

    return [changed(node) for node in nodes]


def _coarse_convolutions(nodes: list[Any], weights: Weights, last: str) -> list[Any]:
    """Convolve before a picture is doubled, not after."""
    dropped: set[str] = set()
    replacements: dict[str, list[Any]] = {}
    for resize in nodes:
        conv = _only_reader(nodes, resize, last) if _is_doubling(resize, weights) else None
        if conv is None or not _is_plain_3x3(conv, weights):
            continue
        if weights[conv.input[1]].size > MOST_WEIGHTS:
            continue
        slope = _only_reader(nodes, conv, last)
        if slope is not None and slope.op_type != "LeakyRelu":
            slope = None
        end = conv if slope is None else slope
        tail = _only_reader(nodes, end, last)
        if tail is not None and not (_is_plain_3x3(tail, weights) and _gives_few(tail, weights)):
            tail = None
        phases = _phases(resize.input[0], conv, slope, weights)
        if tail is None:
            replacements[conv.output[0]] = _interleaved(phases, end.output[0])
        else:
            replacements[conv.output[0]] = _narrowed(phases, tail, weights)
        dropped |= {node.output[0] for node in (resize, slope, tail) if node is not None}
    there = [node for node in nodes if node.output[0] not in dropped]
    return [new for node in there for new in replacements.get(node.output[0], [node])]


def _phases(
    source: str, conv: Any, slope: Any, weights: Weights
) -> Iterator[tuple[tuple[int, int], list[Any]]]:
    """Yield the nodes that make a pixel of every sample, for its four places (row, column)."""
    weight, name = weights[conv.input[1]].astype(np.float64), conv.output[0]
    for y, x in product(range(2), range(2)):
        part = f"{name}_{y}{x}"
        rows = np.stack([weight[:, :, list(taps)].sum(axis=2) for taps in _TAPS[y]], axis=2)
        both = np.stack([rows[..., list(taps)].sum(axis=3) for taps in _TAPS[x]], axis=3)
        weights[f"{part}_weight"] = both.astype(np.float32)
        inputs = [source, f"{part}_weight", *conv.input[2:]]
        nodes = [_conv_2x2(inputs, part, (1 - y, 1 - x))]
        if slope is not None:
            nodes.append(_copied(slope, [part], f"{part}_active"))
        yield (y, x), nodes


def _interleaved(phases: Iterable[tuple[Any, list[Any]]], output: str) -> list[Any]:
    """Return the nodes that put the four pixels of every sample in their places."""
    parts = [nodes for _, nodes in phases]
    every = helper.make_node(
        "Concat", [nodes[-1].output[0] for nodes in parts], [f"{output}_all"], axis=1
    )
    return [*(node for nodes in parts for node in nodes), every, _fine(every.output[0], output)]


def _narrowed(
    phases: Iterable[tuple[tuple[int, int], list[Any]]], tail: Any, weights: Weights
) -> list[Any]:
    """Return the nodes that take each pixel of every sample to the few channels, and add up."""
    weight, output, total = weights[tail.input[1]], tail.output[0], ""
    nodes: list[Any] = []
    for place, phase_nodes in phases:
        part = f"{output}_{place[0]}{place[1]}"
        weights[f"{part}_weight"] = _phase_weight(weight, place)
        inputs = [phase_nodes[-1].output[0], f"{part}_weight"]
        if not total and len(tail.input) > 2:
            weights[f"{part}_bias"] = np.tile(weights[tail.input[2]], 4)
            inputs.append(f"{part}_bias")
        nodes += [*phase_nodes, _conv_2x2(inputs, part, place)]
        if total:
            nodes.append(helper.make_node("Add", [total, part], [f"{part}_sum"]))
        total = nodes[-1].output[0]
    return [*nodes, _fine(total, output)]


def _phase_weight(weight: NDArray[Any], place: tuple[int, int]) -> NDArray[Any]:
    """Return the part of a 3x3 kernel on the fine grid that falls on the pixels of one place.

    Args:
        weight: (k, c, 3, 3).
        place: Row and column of the pixels within their samples, 0 or 1 each.

    Returns:
        (4 k, c, 2, 2), for the four pixels of a sample in reading order.
    """
    phase_weight = np.zeros((2, 2, *weight.shape[:2], 2, 2), np.float32)
    for y, x, i, j in product(range(2), range(2), range(3), range(3)):
        (row, from_y), (column, from_x) = divmod(y + i - 1, 2), divmod(x + j - 1, 2)
        if (from_y, from_x) == place:
            phase_weight[y, x, :, :, row + from_y, column + from_x] = weight[:, :, i, j]
    return phase_weight.reshape(-1, weight.shape[1], 2, 2)


def _conv_2x2(inputs: list[str], output: str, leading: tuple[int, int]) -> Any:
    """Return a convolution that keeps the size: so many rows and columns of zeros come before."""
    pads = [*leading, *(1 - count for count in leading)]
    return helper.make_node("Conv", inputs, [output], kernel_shape=[2, 2], pads=pads)


def _fine(source: str, output: str) -> Any:
    return helper.make_node("DepthToSpace", [source], [output], blocksize=2, mode="DCR")


def _gives_few(node: Any, weights: Weights) -> bool:
    outputs, inputs = weights[node.input[1]].shape[:2]
    return bool(4 * outputs <= inputs)


def _is_doubling(node: Any, weights: Weights) -> bool:
    """Return whether a node gives every sample four times, as a square."""
    if node.op_type != "Resize" or len(node.input) != 3 or node.input[1]:
        return False
    scales, attributes = weights.get(node.input[2]), _attributes(node)
    expected = {
        "mode": b"nearest",
        "coordinate_transformation_mode": b"asymmetric",
        "nearest_mode": b"floor",
    }
    plain = all(attributes.get(key) == value for key, value in expected.items())
    return plain and scales is not None and tuple(scales) == _SCALES


def _is_plain_3x3(node: Any, weights: Weights) -> bool:
    if node.op_type != "Conv" or any(name not in weights for name in node.input[1:]):
        return False
    plain = {"strides": [1, 1], "dilations": [1, 1], "group": 1, "auto_pad": b"NOTSET"}
    attributes = {"pads": [0] * 4, **plain, **_attributes(node)}
    same = all(attributes[key] == value for key, value in {"pads": [1] * 4, **plain}.items())
    return same and bool(weights[node.input[1]].shape[2:] == (3, 3))


def _attributes(node: Any) -> dict[str, Any]:
    return {a.name: helper.get_attribute_value(a) for a in node.attribute}


def _only_reader(nodes: list[Any], node: Any, last: str) -> Any:
    """Return the one node that reads what a node gives; None where others do, or the caller."""
    readers = [other for other in nodes if node.output[0] in other.input]
    return readers[0] if len(readers) == 1 and node.output[0] != last else None


def _copied(node: Any, inputs: list[str], output: str) -> Any:
    copy = helper.make_node(node.op_type, inputs, [output])
    copy.attribute.extend(node.attribute)
    return copy
