"""The only module that knows onnx: what a network may hold, and the facts read from its graph.

    bytes -> parse_graph (refusals) -> Graph -> inspect_graph -> GraphFacts -> check_graph

A graph is admitted if it is sound, small enough, has its weights inside, opset 18 to 20, IR at
most 10, the default domain, no functions, no bodies, and only operators on the list. The list has
what picture networks are made of and whose reach can be told exactly: no Shape, Reshape or
Transpose (tiles have another shape than pictures), no Loop, If or Scan, no MatMul.
"""

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import onnx
from google.protobuf.message import DecodeError as ProtobufError  # type: ignore[import-untyped]
from numpy.typing import NDArray
from onnx import numpy_helper

from camkit.bundle.facts import NetworkFacts
from camkit.errors import BundleError
from camkit.runtime.machine.limits import NETWORK_WORK
from camkit.runtime.network.graph_walk import GraphFacts, walk_graph
from camkit.runtime.network.operators import (
    COMPARISONS,
    ELEMENTWISE,
    GLOBAL_POOLS,
    NORMALIZATIONS,
    REDUCTIONS,
    Node,
)

ALLOWED_OPERATORS: Final = (
    ELEMENTWISE
    | NORMALIZATIONS
    | REDUCTIONS
    | GLOBAL_POOLS
    | {"Conv", "ConvTranspose", "MaxPool", "AveragePool", "Concat", "Slice", "Split", "Pad"}
    | {"DepthToSpace", "SpaceToDepth", "Resize", "Softmax", "Constant"}
)
OPSETS: Final = range(18, 21)
MAX_IR: Final = 10
_MAX_NODES: Final = 4096
_MAX_WIRES: Final = 256
COST_RTOL: Final = 1e-6
_DEFAULT_DOMAINS: Final = ("", "ai.onnx")


@dataclass(frozen=True, slots=True, kw_only=True)
class Graph:
    """A graph that was found admissible, free of protobuf.

    Attributes:
        nodes: In the order of computation, constants taken out.
        constants: Weights and other constants by name.
        input_name: Name of the one input.
        input_channels: Its channels.
        output_name: Name of the one output.
        output_channels: Channels declared for it, None if open.
    """

    nodes: tuple[Node, ...]
    constants: dict[str, NDArray[Any]]
    input_name: str
    input_channels: int
    output_name: str
    output_channels: int | None


def parse_graph(data: bytes) -> Graph:
    """Decode an ONNX model and refuse what is not admissible.

    Args:
        data: The model; it is never read from a path, so nothing outside it can be reached.

    Raises:
        BundleError: For every rule at the head of the module, each with its own message.
    """
    model = _decode(data)
    _check_header(model)
    graph = model.graph
    _check_text(model)
    _check_tensors([*graph.initializer])
    if graph.sparse_initializer:
        raise BundleError("the graph has sparse initializers; refused")
    if len(graph.node) > _MAX_NODES:
        raise BundleError(f"the graph has {len(graph.node)} nodes; at most {_MAX_NODES} are read")
    for index, proto in enumerate(graph.node):
        _check_node(proto, _label(proto, index))
    try:
        onnx.checker.check_model(model)
    except (onnx.checker.ValidationError, ValueError, RuntimeError) as error:
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise BundleError(f"the ONNX is not valid: {reason}") from error
    return _to_graph(graph)


def _decode(data: bytes) -> Any:
    try:
        model = onnx.ModelProto.FromString(data)
    except ProtobufError as error:
        raise BundleError(f"the ONNX is damaged: {error}; export it again") from error
    if not model.graph.node:
        raise BundleError("the ONNX holds no graph; export it again")
    return model


def _check_header(model: Any) -> None:
    if not 1 <= model.ir_version <= MAX_IR:
        raise BundleError(f"the ONNX has IR {model.ir_version}; 1 to {MAX_IR} are admitted")
    domains = [entry.domain for entry in model.opset_import]
    if foreign := [domain for domain in domains if domain not in _DEFAULT_DOMAINS]:
        raise BundleError(
            f"the ONNX imports the domain {foreign[0]!r}; only the default is admitted"
        )
    if len(domains) != 1 or model.opset_import[0].version not in OPSETS:
        versions = [entry.version for entry in model.opset_import]
        raise BundleError(
            f"the ONNX has opset {versions}; one from {OPSETS[0]} to {OPSETS[-1]} is admitted"
        )
    if model.functions:
        raise BundleError(f"the ONNX defines the function {model.functions[0].name!r}; refused")
    if model.training_info:
        raise BundleError("the ONNX holds training information; refused")


def _check_text(message: Any) -> None:
    """Refuse text that is no UTF-8, which protobuf lets through as bytes."""
    for kind, value in message.ListFields():
        values = value if kind.is_repeated else (value,)
        if kind.type == kind.TYPE_STRING and not all(isinstance(one, str) for one in values):
            raise BundleError(
                f"the ONNX is damaged: text in it ({kind.name}) is no UTF-8; export it again"
            )
        if kind.type == kind.TYPE_MESSAGE:
            for one in values:
                _check_text(one)


def _check_tensors(tensors: Sequence[Any]) -> None:
    for tensor in tensors:
        if tensor.data_location == onnx.TensorProto.EXTERNAL or tensor.external_data:
            raise BundleError(
                f"tensor {tensor.name!r} lies outside the ONNX (external data); "
                "export with the weights inside"
            )
        declared, stored = math.prod(tensor.dims), _held_values(tensor)
        if not 0 <= declared <= stored:
            raise BundleError(
                f"tensor {tensor.name!r} declares {declared} values, it holds {stored}"
            )


def _held_values(tensor: Any) -> int:
    """Return the most values a tensor can hold, were they of 4 bits."""
    fields = ("float_data", "int32_data", "int64_data", "double_data", "uint64_data")
    return 2 * len(tensor.raw_data) + 8 * sum(len(getattr(tensor, name)) for name in fields)


def _label(proto: Any, index: int) -> str:
    return str(proto.name) or f"{proto.op_type} #{index}"


def _check_node(proto: Any, label: str) -> None:
    if max(len(proto.input), len(proto.output)) > _MAX_WIRES:
        raise BundleError(f"{label}: more than {_MAX_WIRES} inputs or outputs; refused")
    if proto.domain not in _DEFAULT_DOMAINS:
        raise BundleError(f"{label}: operator of domain {proto.domain!r}; refused")
    for attribute in proto.attribute:
        if attribute.HasField("g") or attribute.graphs:
            raise BundleError(f"{label}: {proto.op_type} has a body (control flow); refused")
        if attribute.HasField("sparse_tensor") or attribute.sparse_tensors:
            raise BundleError(f"{label}: sparse constants are refused")
        if attribute.ref_attr_name:
            raise BundleError(f"{label}: attribute refers to a function; refused")
        tensors = [attribute.t] if attribute.HasField("t") else []
        _check_tensors([*tensors, *attribute.tensors])
    if proto.op_type not in ALLOWED_OPERATORS:
        raise BundleError(f"{label}: operator {proto.op_type} is not on the list of admitted ones")


def _to_graph(graph: Any) -> Graph:
    constants = {tensor.name: _to_array(tensor) for tensor in graph.initializer}
    nodes = []
    for index, proto in enumerate(graph.node):
        attributes = {a.name: onnx.helper.get_attribute_value(a) for a in proto.attribute}
        label = _label(proto, index)
        if proto.op_type == "Constant":
            constants[proto.output[0]] = _constant(attributes, label)
            continue
        node = Node(
            op=proto.op_type,
            label=label,
            inputs=tuple(proto.input),
            outputs=tuple(proto.output),
            attributes=attributes,
        )
        nodes.append(node)
    inputs = [value for value in graph.input if value.name not in constants]
    if len(inputs) != 1 or len(graph.output) != 1:
        raise BundleError(
            f"a network has one input and one output; got {len(inputs)} and {len(graph.output)}"
        )
    channels = _channels(inputs[0], what="input")
    if channels is None:
        raise BundleError(f"input {inputs[0].name!r} must state its channels")
    return Graph(
        nodes=tuple(nodes),
        constants=constants,
        input_name=inputs[0].name,
        input_channels=channels,
        output_name=graph.output[0].name,
        output_channels=_channels(graph.output[0], what="output"),
    )


def _to_array(tensor: Any) -> NDArray[Any]:
    try:
        array: NDArray[Any] = numpy_helper.to_array(tensor)
    except (ValueError, TypeError, KeyError) as error:
        raise BundleError(f"tensor {tensor.name!r} cannot be decoded: {error}") from error
    if array.dtype.kind not in "fiub":
        raise BundleError(f"tensor {tensor.name!r} holds {array.dtype}; refused")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise BundleError(f"tensor {tensor.name!r} holds NaN or inf; export the network again")
    return array


def _constant(attributes: dict[str, Any], label: str) -> NDArray[Any]:
    if "value" in attributes:
        return _to_array(attributes["value"])
    for name in ("value_float", "value_floats", "value_int", "value_ints"):
        if name in attributes:
            return np.array(attributes[name])
    raise BundleError(f"{label}: only constants of numbers are admitted")


def _channels(value: Any, *, what: str) -> int | None:
    """Check that a tensor is float32 (1, channels, open, open); return its channels."""
    kind = value.type.tensor_type
    if kind.elem_type != onnx.TensorProto.FLOAT:
        names = {number: name for name, number in onnx.TensorProto.DataType.items()}
        name = names.get(kind.elem_type, f"type {kind.elem_type}")
        raise BundleError(f"{what} {value.name!r} must be float32; got {name}")
    dims = list(kind.shape.dim)
    if len(dims) != 4:
        raise BundleError(
            f"{what} {value.name!r} must be (1, channels, height, width); got {len(dims)} axes"
        )
    if dims[0].HasField("dim_value") and dims[0].dim_value != 1:
        raise BundleError(f"{what} {value.name!r} must have batch 1; got {dims[0].dim_value}")
    if any(dim.HasField("dim_value") for dim in dims[2:]):
        raise BundleError(f"{what} {value.name!r} must leave height and width open")
    return int(dims[1].dim_value) if dims[1].HasField("dim_value") else None


def inspect_graph(data: bytes) -> GraphFacts:
    """Read the facts of a network from its graph.

    Args:
        data: The ONNX model.

    Raises:
        BundleError: If it is not admissible, or its output is on no grid of its input.
    """
    graph = parse_graph(data)
    return walk_graph(
        graph.nodes,
        graph.constants,
        source=(graph.input_name, graph.input_channels),
        target=(graph.output_name, graph.output_channels),
    )


def check_graph(data: bytes, facts: NetworkFacts) -> GraphFacts:
    """Check a network against what the manifest says about it.

    Args:
        data: The ONNX model.
        facts: Its entry in the manifest.

    Returns:
        What was read from the graph.

    Raises:
        BundleError: If the graph is not admissible or contradicts the manifest in names,
            channels, scale, stride or global operators, reaches further or holds more memory than
            it says, or computes more than is admitted.
    """
    graph = inspect_graph(data)
    pairs = {
        "input name": (graph.input_name, facts.input_name),
        "input channels": (graph.input_channels, facts.input_channels),
        "output name": (graph.output_name, facts.output_name),
        "output channels": (graph.output_channels, facts.output_channels),
        "output scale": (graph.output_scale, facts.output_scale),
        "stride": (graph.stride_px, facts.stride_px),
        "global operators": (graph.global_operators, facts.global_operators),
    }
    for what, (got, expected) in pairs.items():
        if got != expected:
            raise BundleError(
                f"{facts.member}: {what} of the graph is {got!r}, the manifest says {expected!r}; "
                "export the bundle again"
            )
    # More memory than the walk counts may have been measured; less cannot be.
    if graph.bytes_per_pixel > facts.bytes_per_pixel * (1 + COST_RTOL):
        raise BundleError(
            f"{facts.member}: bytes_per_pixel is {graph.bytes_per_pixel:g}, the manifest says "
            f"{facts.bytes_per_pixel:g}; too little memory would be planned. Export the bundle "
            "again"
        )
    NETWORK_WORK.check(graph.work_per_pixel, f"the network {facts.member}")
    if graph.receptive_field_radius_px > facts.reach_px:
        raise BundleError(
            f"{facts.member}: the graph reaches {graph.receptive_field_radius_px} px, the manifest "
            f"says {facts.reach_px}; tiles would show seams. Export the bundle again"
        )
    return graph


def with_node_outputs(data: bytes) -> tuple[bytes, tuple[str, ...]]:
    """Return a model whose every tensor of numbers is an output, to measure activations.

    Returns:
        The model, and the names of its outputs in the order of the graph.

    Raises:
        BundleError: If the model is not admissible.
    """
    graph = parse_graph(data)
    nodes = (node for node in graph.nodes if node.op not in COMPARISONS)
    names = tuple(dict.fromkeys(name for node in nodes for name in node.outputs if name))
    model = _decode(data)
    del model.graph.output[:]
    model.graph.output.extend(
        onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, None) for name in names
    )
    return model.SerializeToString(), names


def partial_model(
    data: bytes,
    tensors: Set[str],
    inputs: Sequence[tuple[str, int]],
    outputs: Sequence[tuple[str, int]],
) -> bytes:
    """Return some nodes of a model as a model of its own.

    Args:
        data: The model, admissible.
        tensors: What the nodes compute.
        inputs: Name and channels of what they take.
        outputs: Name and channels of what is asked of them.
    """
    model = _decode(data)
    graph = model.graph
    nodes = [node for node in graph.node if tensors & set(node.output)]
    read_names = {name for node in nodes for name in node.input}
    constants = [n for n in graph.node if n.op_type == "Constant" and read_names & set(n.output)]
    weights = [tensor for tensor in graph.initializer if tensor.name in read_names]
    for part, values in ((graph.node, [*constants, *nodes]), (graph.initializer, weights)):
        copies = [type(value).FromString(value.SerializeToString()) for value in values]
        del part[:]
        part.extend(copies)
    for part, ports in ((graph.input, inputs), (graph.output, outputs)):
        del part[:]
        part.extend(
            onnx.helper.make_tensor_value_info(
                name, onnx.TensorProto.FLOAT, [1, channels, None, None]
            )
            for name, channels in ports
        )
    del graph.value_info[:]
    return bytes(model.SerializeToString())
