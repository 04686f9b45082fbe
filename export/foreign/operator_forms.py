"""Every node in the form that opset 20 and the graph reader know; sizes that move are taken out.

Identity, Dropout, Cast, whole Slice, Pad by 0,   nothing
Expand and Resize to the same size
Pow 2, 0.5, 1                                     Mul, Sqrt, nothing
Reciprocal, Sum, Mean, ReduceL2, HardSigmoid ...  their parts
axes and parts as attributes                      as inputs
Resize to a size                                  Resize by a factor
GroupNormalization, InstanceNormalization,        their parts, so that what looks at the whole
a norm of channels that lie last                  picture is a mean
"""

from collections.abc import Callable
from fractions import Fraction
from typing import Any, Final

import numpy as np

from camkit.export.foreign.draft import Draft, attributes_of, make_node, scalar
from camkit.export.foreign.norms import channel_norm, group_norm, instance_norm
from camkit.runtime.network.operators import COMPARISONS

Form = Callable[[Draft, Any], bool]
"""Rewrites a node if it can; returns whether it did."""
_REDUCTIONS: Final = ("ReduceMean", "ReduceSum", "ReduceMax", "ReduceMin", "ReduceL2")
_SAME: Final = ("Identity", "Dropout", "Slice", "Expand", "Reshape", "Pad", "Resize", "Cast")
_SAME_IF_EQUAL: Final = ("Flatten", "Squeeze", "Unsqueeze", "Transpose", "Concat", "Tile")
_MAX_FACTOR: Final = 64


def rewrite_nodes(draft: Draft) -> None:
    """Rewrite the nodes of a draft until nothing changes."""
    changed = True
    while changed:
        changed = False
        for node in list(draft.nodes):
            if node not in draft.nodes:
                continue
            changed |= any(form(draft, node) for form in _FORMS)
        draft.prune()


def _nothing(draft: Draft, node: Any) -> bool:
    """Remove a node that gives its input as it is."""
    if node.op_type not in _SAME or node.output[0] not in draft.shapes:
        return False
    if len(node.output) > 1 and any(draft.readers(name) for name in node.output[1:]):
        return False
    source = node.input[0]
    same = draft.shapes.get(source) == draft.shapes[node.output[0]]
    if not same and node.op_type not in ("Identity", "Dropout"):
        return False
    if node.op_type == "Slice" and not _is_forward(draft, node):
        return False
    if node.op_type == "Cast" and (attributes_of(node)["to"] != 1 or _is_truth(draft, source)):
        return False
    if node.op_type == "Identity" and source == draft.source and node.output[0] == draft.target:
        return False
    draft.bypass(node)
    return True


def _is_truth(draft: Draft, name: str) -> bool:
    return any(name in node.output and node.op_type in COMPARISONS for node in draft.nodes)


def _mask(draft: Draft, node: Any) -> bool:
    """Make numbers of what a comparison gives by a Where."""
    if node.op_type != "Cast" or not _is_truth(draft, node.input[0]):
        return False
    one, zero = (draft.constant(np.float32(value)) for value in (1, 0))
    draft.replace([node], [make_node("Where", [node.input[0], one, zero], node.output[0])])
    return True


def _is_forward(draft: Draft, node: Any) -> bool:
    steps = draft.constants.get(node.input[4]) if len(node.input) > 4 else None
    return steps is None or bool((steps > 0).all())


def _power(draft: Draft, node: Any) -> bool:
    exponent = scalar(draft.constants, node.input[1]) if node.op_type == "Pow" else None
    source, result = node.input[0], node.output[0]
    if exponent == 2.0:
        draft.replace([node], [make_node("Mul", [source, source], result)])
    elif exponent == 0.5:
        draft.replace([node], [make_node("Sqrt", [source], result)])
    elif exponent == 1.0:
        draft.bypass(node)
    else:
        return _floating(draft, node) if exponent is not None else False
    return True


def _floating(draft: Draft, node: Any) -> bool:
    """Make an exponent of whole numbers float32, as the picture is."""
    values = draft.constants[node.input[1]]
    if values.dtype == np.float32:
        return False
    node.input[1] = draft.constant(values.astype(np.float32))
    return True


def _parts(draft: Draft, node: Any) -> bool:
    """Replace a node by plain ones."""
    op, result = node.op_type, node.output[0]
    if op == "Reciprocal":
        one = draft.constant(np.float32(1))
        draft.replace([node], [make_node("Div", [one, node.input[0]], result)])
        return True
    if op == "Sum" and len(node.input) > 1:
        draft.replace([node], _added(draft, list(node.input), result))
        return True
    if op == "ReduceL2":
        square, total = draft.name("square"), draft.name("total")
        summed = make_node("ReduceSum", [square, *node.input[1:]], total)
        summed.attribute.extend(node.attribute)
        nodes = [make_node("Mul", [node.input[0]] * 2, square), summed]
        draft.replace([node], [*nodes, make_node("Sqrt", [total], result)])
        return True
    if op == "Swish" or (op == "Mish" and draft.opset >= 18):
        return _gated(draft, node)
    return False


def _gated(draft: Draft, node: Any) -> bool:
    """Replace an activation by the picture times a curve of it."""
    source, result, curve = node.input[0], node.output[0], draft.name("curve")
    if node.op_type == "Mish":
        soft = draft.name("soft")
        nodes = [make_node("Softplus", [source], soft), make_node("Tanh", [soft], curve)]
    elif attributes_of(node).get("alpha", 1.0) == 1.0:
        nodes = [make_node("Sigmoid", [source], curve)]
    else:
        return False
    draft.replace([node], [*nodes, make_node("Mul", [source, curve], result)])
    return True


def _added(draft: Draft, names: list[str], result: str) -> list[Any]:
    nodes, total = [], names[0]
    for place, name in enumerate(names[1:], start=2):
        output = result if place == len(names) else draft.name("sum")
        nodes.append(make_node("Add", [total, name], output))
        total = output
    return nodes


def _axes(draft: Draft, node: Any) -> bool:
    """Write the axes of a reduction as an input, counted from 0."""
    if node.op_type not in _REDUCTIONS or node.input[0] not in draft.shapes:
        return False
    attributes, rank = attributes_of(node), len(draft.shapes[node.input[0]][0])
    if len(node.input) > 1:
        axes = draft.constants.get(node.input[1], np.zeros(0, np.int64)).ravel().tolist()
    else:
        axes = list(attributes.get("axes", []))
    whole = sorted(axis % rank for axis in axes) or list(range(rank))
    if len(node.input) > 1 and axes == whole:
        return False
    name = draft.constant(np.array(whole, np.int64))
    keep = attributes.get("keepdims", 1)
    new = make_node(node.op_type, [node.input[0], name], node.output[0], keepdims=keep)
    draft.replace([node], [new])
    return True


def _split(draft: Draft, node: Any) -> bool:
    if node.op_type != "Split" or (len(node.input) > 1 and node.input[1]):
        return False
    attributes = attributes_of(node)
    sizes, axis = attributes.get("split"), attributes.get("axis", 0)
    if sizes is None and any(name not in draft.shapes for name in node.output):
        return False
    if sizes is None:
        sizes = [draft.shapes[name][0][axis] for name in node.output]
    new = make_node("Split", [node.input[0], draft.constant(np.array(sizes))], "", axis=axis)
    del new.output[:]
    new.output.extend(node.output)
    draft.replace([node], [new])
    return True


def _resize(draft: Draft, node: Any) -> bool:
    """Replace a Resize to a size by one by a factor where a size of the picture is asked for."""
    if node.op_type != "Resize" or len(node.input) < 4 or not node.input[3]:
        return False
    if node.input[0] not in draft.shapes or node.output[0] not in draft.shapes:
        return False
    shapes = draft.shapes[node.input[0]], draft.shapes[node.output[0]]
    factors = {
        tuple(Fraction(b, a) for a, b in zip(source, result, strict=True))
        for source, result in zip(*shapes, strict=True)
    }
    if len(factors) != 1:
        return False
    scales = np.array([float(f) for f in factors.pop()], np.float32)
    new = make_node("Resize", [node.input[0], "", draft.constant(scales)], node.output[0])
    new.attribute.extend(node.attribute)
    draft.replace([node], [new])
    return True


def _sliced(draft: Draft, node: Any) -> bool:
    """Write every Slice along the channels by constant bounds."""
    if node.op_type != "Slice" or node.output[0] not in draft.shapes:
        return False
    if len(node.input) < 3 or all(name in draft.constants for name in node.input[1:] if name):
        return False
    source, result = (draft.shapes[name][0] for name in (node.input[0], node.output[0]))
    if source[2:] != result[2:] or len(source) != 4:
        return False
    starts = draft.constants.get(node.input[1])
    if starts is None or starts.size != 1:
        return False
    bounds = (int(starts.ravel()[0]), int(starts.ravel()[0]) + result[1], 1)
    names = [draft.constant(np.array([value], np.int64)) for value in bounds]
    draft.replace([node], [make_node("Slice", [node.input[0], *names], node.output[0])])
    return True


def _softmax(draft: Draft, node: Any) -> bool:
    """Write the axis of a Softmax, which was another one before opset 13."""
    if node.op_type != "Softmax" or node.output[0] not in draft.shapes:
        return False
    rank = len(draft.shapes[node.output[0]][0])
    axis = attributes_of(node).get("axis", 1 if draft.opset < 13 else -1) % rank
    if draft.opset < 13 and axis != rank - 1:
        return False
    if attributes_of(node).get("axis") == axis:
        return False
    draft.replace([node], [make_node("Softmax", [node.input[0]], node.output[0], axis=axis)])
    return True


_FORMS: Final[tuple[Form, ...]] = (
    *(_nothing, _mask, _power, _parts, _axes, _split, _resize, _sliced, _softmax),
    *(instance_norm, group_norm, channel_norm),
)
