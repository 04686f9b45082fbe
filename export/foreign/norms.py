"""Norms by their parts, so that what looks at the whole picture is a mean.

InstanceNormalization                         every channel over rows and columns
Reshape, InstanceNormalization, Reshape       groups of channels over rows and columns
GroupNormalization                            the same
Transpose, LayerNormalization, Transpose      every pixel over its channels
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from camkit.export.foreign.draft import Array, Draft, attributes_of, make_node

_SPATIAL: Final = [2, 3]
_EPSILON: Final = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class Norm:
    """(x - mean) / sqrt(variance + epsilon), times a scale, plus a bias.

    Attributes:
        axes: Over which mean and variance are taken.
        scale: (1, c, 1, 1).
        bias: (1, c, 1, 1).
        epsilon: Added to the variance.
        groups: Whose channels share mean and variance; 0 for each channel its own.
    """

    axes: list[int]
    scale: Array
    bias: Array
    epsilon: float
    groups: int = 0


def instance_norm(draft: Draft, node: Any) -> bool:
    """Replace a norm of every channel over the picture."""
    if node.op_type != "InstanceNormalization" or len(draft.shapes[node.output[0]][0]) != 4:
        return False
    norm = _affine(draft, node, draft.channels(node.input[0]))
    if norm is None:
        return False
    draft.replace([node], _parts(draft, node.input[0], node.output[0], norm))
    return True


def group_norm(draft: Draft, node: Any) -> bool:
    """Replace a norm of groups of channels, as a node or between two Reshapes."""
    if node.op_type == "GroupNormalization":
        groups = int(attributes_of(node)["num_groups"])
        norm = _affine(draft, node, draft.channels(node.input[0]), groups)
        if norm is None:
            return False
        draft.replace([node], _parts(draft, node.input[0], node.output[0], norm))
        return True
    if node.op_type != "InstanceNormalization" or len(draft.shapes[node.output[0]][0]) != 3:
        return False
    before = next((n for n in draft.nodes if node.input[0] in n.output), None)
    after = draft.only_reader(node.output[0])
    if before is None or after is None or {before.op_type, after.op_type} != {"Reshape"}:
        return False
    whole, groups = draft.shapes.get(before.input[0]), draft.shapes[node.input[0]][0][1]
    if whole is None or len(whole[0]) != 4 or draft.shapes.get(after.output[0]) != whole:
        return False
    norm = _affine(draft, node, whole[0][1], groups)
    if norm is None or whole[0][1] % groups:
        return False
    draft.replace([node, after], _parts(draft, before.input[0], after.output[0], norm))
    return True


def channel_norm(draft: Draft, node: Any) -> bool:
    """Replace a norm of channels that were put last, between two Transposes."""
    if node.op_type != "LayerNormalization" or len(node.output) != 1:
        return False
    before = next((n for n in draft.nodes if node.input[0] in n.output), None)
    after = draft.only_reader(node.output[0])
    for neighbour, order in ((before, [0, 2, 3, 1]), (after, [0, 3, 1, 2])):
        if neighbour is None or neighbour.op_type != "Transpose":
            return False
        if list(attributes_of(neighbour).get("perm", [])) != order:
            return False
    if attributes_of(node).get("axis", -1) not in (-1, 3) or node.input[1] not in draft.constants:
        return False
    assert before is not None
    scale = draft.constants[node.input[1]].reshape(1, -1, 1, 1)
    has_bias = len(node.input) > 2 and bool(node.input[2])
    bias = draft.constants[node.input[2]].reshape(scale.shape) if has_bias else 0 * scale
    epsilon = attributes_of(node).get("epsilon", _EPSILON)
    norm = Norm(axes=[1], scale=scale, bias=bias, epsilon=epsilon)
    draft.replace([node, after], _parts(draft, before.input[0], after.output[0], norm))
    return True


def _affine(draft: Draft, node: Any, channels: int, groups: int = 0) -> Norm | None:
    """Return the norm of a node; None if its scale and bias are computed."""
    if not all(name in draft.constants for name in node.input[1:3]):
        return None
    arrays = [draft.constants[name].ravel() for name in node.input[1:3]]
    if any(channels % array.size for array in arrays):
        return None
    scale, bias = (np.repeat(a, channels // a.size).reshape(1, -1, 1, 1) for a in arrays)
    epsilon = attributes_of(node).get("epsilon", _EPSILON)
    return Norm(axes=_SPATIAL, scale=scale, bias=bias, epsilon=epsilon, groups=groups)


def _parts(draft: Draft, source: str, result: str, norm: Norm) -> list[Any]:
    """Return the nodes of a norm."""
    mean, difference, square, variance, lifted, root, even, scaled = map(
        draft.name, ("mean", "rest", "square", "variance", "lifted", "root", "even", "scaled")
    )
    nodes = [
        *_mean(draft, source, mean, norm),
        make_node("Sub", [source, mean], difference),
        make_node("Mul", [difference, difference], square),
        *_mean(draft, square, variance, norm),
        make_node("Add", [variance, draft.constant(np.float32(norm.epsilon))], lifted),
        make_node("Sqrt", [lifted], root),
        make_node("Div", [difference, root], even),
        make_node("Mul", [even, draft.constant(np.asarray(norm.scale, np.float32))], scaled),
        make_node("Add", [scaled, draft.constant(np.asarray(norm.bias, np.float32))], result),
    ]
    whole = draft.shapes[source]
    first, second = (
        tuple(1 if i in norm.axes else n for i, n in enumerate(shape)) for shape in whole
    )
    draft.shapes |= dict.fromkeys((difference, square, even, scaled), whole)
    draft.shapes |= dict.fromkeys((mean, variance, lifted, root), (first, second))
    return nodes


def _mean(draft: Draft, source: str, result: str, norm: Norm) -> list[Any]:
    """Return the nodes of a mean, that of a group for each of its channels."""
    axes = draft.constant(np.array(norm.axes, np.int64))
    if not norm.groups:
        return [make_node("ReduceMean", [source, axes], result, keepdims=1)]
    channels, mean = norm.scale.size, draft.name("channel_mean")
    size = channels // norm.groups
    weight = np.kron(np.eye(norm.groups), np.full((size, size), 1 / size)).astype(np.float32)
    return [
        make_node("ReduceMean", [source, axes], mean, keepdims=1),
        make_node("Conv", [mean, draft.constant(weight[:, :, None, None])], result),
    ]
