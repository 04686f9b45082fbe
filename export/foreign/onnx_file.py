"""A network's ONNX as its owner exported it, decoded: weights inside, float32, open sides."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnx
from google.protobuf.message import DecodeError as ProtobufError  # type: ignore[import-untyped]
from onnx import TensorProto, helper, numpy_helper

from camkit.errors import BundleError, DecodeError
from camkit.regular_file import check_regular
from camkit.runtime.network.graph import MAX_IR

OPSETS: Final = range(11, 24)
_DOMAINS: Final = ("", "ai.onnx")
_HALVES: Final = frozenset({TensorProto.FLOAT16, TensorProto.BFLOAT16, TensorProto.DOUBLE})
_NAMES: Final = {number: name.lower() for name, number in TensorProto.DataType.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignModel:
    """A model of somebody else.

    Attributes:
        proto: In float32, with height and width open and the weights inside.
        original: Serialised, in its own type of numbers, else the same.
        source: Name of its input.
        target: Name of its output.
        channels: Of its input.
        opset: That it was exported with.
        type: Of its input: float, float16, ...
        obstacles: What stands in its way before a node is looked at.
    """

    proto: Any
    original: bytes
    source: str
    target: str
    channels: int
    opset: int
    type: str
    obstacles: tuple[str, ...]


def read_model(path: Path) -> ForeignModel:
    """Read a file, with the weights that lie in files beside it.

    Raises:
        DecodeError: If it cannot be read, or is no ONNX.
        BundleError: If it has no single picture as input.
    """
    try:
        check_regular(path)
        proto = onnx.load(path)
    except OSError as error:
        raise DecodeError(f"cannot read {path}: {error.strerror or error}") from error
    except (ProtobufError, onnx.checker.ValidationError, ValueError) as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise DecodeError(f"{path} is no ONNX that can be read: {reason}") from error
    if not proto.graph.node:
        raise DecodeError(f"{path} holds no graph; export the network again")
    return foreign_model(proto)


def foreign_model(proto: Any) -> ForeignModel:
    """Return a model made ready to be rewritten.

    Args:
        proto: An onnx.ModelProto with the weights inside; it is changed.

    Raises:
        BundleError: If it has no single picture as input.
    """
    if proto.functions:
        proto = onnx.inliner.inline_local_functions(proto)
    versions = {entry.domain: entry.version for entry in proto.opset_import}
    opset = next((versions[domain] for domain in _DOMAINS if domain in versions), 0)
    type_ = _NAMES.get(_input(proto).type.tensor_type.elem_type, "unknown")
    channels = _open_sides(proto)
    del proto.graph.value_info[:]
    proto.ir_version = min(proto.ir_version, MAX_IR)
    original = bytes(proto.SerializeToString())
    _widen(proto)
    return ForeignModel(
        proto=proto,
        original=original,
        source=str(_input(proto).name),
        target=str(proto.graph.output[0].name),
        channels=channels,
        opset=opset,
        type=type_,
        obstacles=tuple(_obstacles(proto, opset, type_)),
    )


def _obstacles(proto: Any, opset: int, type_: str) -> list[str]:
    findings = []
    if opset not in OPSETS:
        findings.append(f"opset {opset}; {OPSETS[0]} to {OPSETS[-1]} are taken: export it again")
    if len(proto.graph.output) != 1:
        names = ", ".join(value.name for value in proto.graph.output)
        findings.append(f"{len(proto.graph.output)} outputs ({names}); one is taken")
    if type_ not in ("float", "float16", "bfloat16", "double"):
        findings.append(f"an input of {type_}; numbers of floating point are taken")
    foreign = {(node.domain, node.op_type) for node in proto.graph.node} - {
        (domain, node.op_type) for domain in _DOMAINS for node in proto.graph.node
    }
    findings += [f"operator {op} of the domain {domain}" for domain, op in sorted(foreign)]
    return findings


def _input(proto: Any) -> Any:
    constants = {tensor.name for tensor in proto.graph.initializer}
    inputs = [value for value in proto.graph.input if value.name not in constants]
    if len(inputs) != 1:
        names = ", ".join(value.name for value in inputs)
        raise BundleError(
            f"the network has {len(inputs)} inputs ({names}); one picture is taken. Export it with "
            "its planes concatenated"
        )
    return inputs[0]


def _open_sides(proto: Any) -> int:
    """Open height and width, one picture at a time; return the channels of the input."""
    port = _input(proto)
    dims = list(port.type.tensor_type.shape.dim)
    if len(dims) != 4:
        raise BundleError(
            f"its input {port.name!r} has {len(dims)} axes; (1, channels, height, width) is taken"
        )
    channels = dims[1].dim_value if dims[1].HasField("dim_value") else _first_weights(proto)
    if not channels:
        raise BundleError(f"its input {port.name!r} does not state its channels")
    kind = port.type.tensor_type.elem_type
    port.CopyFrom(helper.make_tensor_value_info(port.name, kind, [1, channels, "height", "width"]))
    for output in proto.graph.output:
        output.type.tensor_type.ClearField("shape")
    return int(channels)


def _first_weights(proto: Any) -> int:
    """Return the channels that the first convolution takes; 0 if there is none."""
    shapes = {tensor.name: tuple(tensor.dims) for tensor in proto.graph.initializer}
    for node in proto.graph.node:
        if node.op_type == "Conv" and node.input[1] in shapes:
            return int(shapes[node.input[1]][1])
    return 0


def _widen(proto: Any) -> None:
    """Convert numbers of half, brain and double precision to float32, in place."""
    graph = proto.graph
    for tensor in graph.initializer:
        _widen_tensor(tensor)
    for value in (*graph.input, *graph.output):
        if value.type.tensor_type.elem_type in _HALVES:
            value.type.tensor_type.elem_type = TensorProto.FLOAT
    for node in graph.node:
        for attribute in node.attribute:
            if attribute.HasField("t"):
                _widen_tensor(attribute.t)
            if node.op_type == "Cast" and attribute.name == "to" and attribute.i in _HALVES:
                attribute.i = TensorProto.FLOAT


def _widen_tensor(tensor: Any) -> None:
    if tensor.data_type in _HALVES:
        values = numpy_helper.to_array(tensor).astype(np.float32)
        tensor.CopyFrom(numpy_helper.from_array(values, tensor.name))
