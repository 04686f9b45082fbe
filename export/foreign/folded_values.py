"""Tensors that do not depend on the picture, found by running the network at two sizes.

constants alone           -> constants
Shape of a tensor         -> values at both sizes: constants where equal, moving where not
the picture               -> stays, with its shape at both sizes
"""

from typing import Any, Final

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from camkit.errors import BundleError
from camkit.export.foreign.draft import Array, Draft, Shape, make_node
from camkit.export.foreign.onnx_file import ForeignModel
from camkit.runtime.network.engine import tensor_values

SIZES_PX: Final = ((64, 192), (128, 320))
"""Two pictures, (height, width): multiples of any usual stride, with no ratio in common."""
_SHAPES: Final = frozenset({"Shape", "Size"})
_RANDOM: Final = frozenset(
    {"RandomNormal", "RandomUniform", "RandomNormalLike", "RandomUniformLike", "Bernoulli"}
)


def folded(model: ForeignModel) -> Draft:
    """Return the nodes that depend on the picture, everything else computed.

    Raises:
        BundleError: If onnxruntime cannot run the network at two sizes.
    """
    proto, graph = model.proto, model.proto.graph
    constants = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    still = _independent(graph.node, set(constants) | {""})
    names = [name for node in still for name in node.output if name]
    first, second = (_values(proto, names, model.source, model.channels, size) for size in SIZES_PX)
    moving: dict[str, tuple[Array, Array]] = {}
    for name in names:
        if first[name].shape == second[name].shape and np.array_equal(first[name], second[name]):
            constants[name] = first[name]
        else:
            moving[name] = first[name], second[name]
    still_ids = {id(node) for node in still}
    draft = Draft(
        nodes=[_copied(node) for node in graph.node if id(node) not in still_ids],
        constants=constants,
        moving=moving,
        shapes={},
        source=model.source,
        target=model.target,
        opset=model.opset,
    )
    draft.prune()
    draft.shapes = _shapes(draft, model.channels)
    return draft


def _copied(node: Any) -> Any:
    copy = onnx.NodeProto()
    copy.CopyFrom(node)
    return copy


def _independent(nodes: Any, still_names: set[str]) -> list[Any]:
    """Return the nodes that do not look at the picture's samples."""
    still = []
    for node in nodes:
        if node.op_type in _RANDOM:
            continue
        if node.op_type in _SHAPES or still_names.issuperset(node.input):
            still_names.update(node.output)
            still.append(node)
    return still


def _values(
    proto: Any, names: list[str], source: str, channels: int, size_px: tuple[int, int]
) -> dict[str, Array]:
    if not names:
        return {}
    copy = onnx.ModelProto()
    copy.CopyFrom(proto)
    del copy.graph.output[:]
    copy.graph.output.extend(onnx.ValueInfoProto(name=name) for name in names)
    picture = np.zeros((1, channels, *size_px), np.float32)
    try:
        return tensor_values(copy.SerializeToString(), names, {source: picture})
    except BundleError as error:
        height, width = size_px
        raise BundleError(
            f"the network does not run on a picture of {width}x{height}: {error}. Its sizes may be "
            "those of the export; export it with open height and width"
        ) from error


def _shapes(draft: Draft, channels: int) -> dict[str, tuple[Shape, Shape]]:
    first, second = (_shapes_at(draft, channels, index) for index in range(2))
    return {name: (shape, second[name]) for name, shape in first.items() if name in second}


def _shapes_at(draft: Draft, channels: int, index: int) -> dict[str, Shape]:
    """Return the shapes of all tensors at one of the two sizes."""
    constants = draft.constants | {name: both[index] for name, both in draft.moving.items()}
    picture = helper.make_tensor_value_info(
        draft.source, TensorProto.FLOAT, [1, channels, *SIZES_PX[index]]
    )
    # the shape of this operator is not inferred
    nodes = [
        make_node("Identity", [node.input[0]], node.output[0])
        if node.op_type == "GroupNormalization"
        else node
        for node in draft.nodes
    ]
    graph = helper.make_graph(
        nodes,
        "shapes",
        [picture],
        [onnx.ValueInfoProto(name=draft.target)],
        [numpy_helper.from_array(np.ascontiguousarray(a), name) for name, a in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", draft.opset)])
    inferred = onnx.shape_inference.infer_shapes(model, data_prop=True).graph
    shapes: dict[str, Shape] = {draft.source: (1, channels, *SIZES_PX[index])}
    for value in (*inferred.value_info, *inferred.output):
        dims = value.type.tensor_type.shape.dim
        if value.type.tensor_type.HasField("shape") and all(d.HasField("dim_value") for d in dims):
            shapes[value.name] = tuple(d.dim_value for d in dims)
    return shapes
