"""Faults of a network: operators, attributes, wires, weights, names, shapes, versions."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import onnx
from onnx import helper, numpy_helper

from camkit.runtime.network.graph import ALLOWED_OPERATORS
from tests.hostile.decisions import Decisions

_NUMBERS = (0, 1, -1, 2, 3, 4, 7, 8, 16, 64, 100, 4096, 100_000, 2**31 - 1, 2**40, -(2**40))
_NAMES = ("kernel_shape", "strides", "pads", "dilations", "group", "blocksize", "axis", "alpha")
_MORE = ("auto_pad", "ceil_mode", "mode", "epsilon", "keepdims", "to", "num_groups", "perm")
_SHAPES = ((), (0,), (1,), (3,), (6,), (1, 1), (8, 6, 4, 4), (3, 6, 1, 1), (1, 3, 1, 1), (2, 0))
_WIDTHS = (1, 3, 4, 5, 16, 50, 300, 3000, 40_000)
_KERNELS = (1, 3, 5, 9, 33, 101, 301)
_UNARY = ("Relu", "Abs", "Sqrt", "Neg", "Sigmoid", "Tanh", "Softplus", "Elu", "Gelu", "HardSwish")
_MOST_WEIGHTS = 2_000_000
_OPERATORS = (*sorted(ALLOWED_OPERATORS), "Loop", "MatMul", "Shape", "Nonsense", "")


def changed_model(data: bytes, choose: Decisions) -> bytes:
    """Give a changed ONNX model."""
    model = onnx.ModelProto.FromString(data)
    for _ in range(1 + choose.index(3)):
        _change(model, choose)
    made: bytes = model.SerializeToString(deterministic=True)
    if choose.index(12) == 1:  # a name that is no UTF-8
        name = choose.pick((b"head", b"input", b"output", b"body", b"tail"))
        made = made.replace(name, b"\xff\xfe" + name[2:], 1 + choose.index(4))
    return made


def _change(model: Any, choose: Decisions) -> None:
    change = choose.pick(_CHANGES)
    if change in (_change_port, _change_version):
        change(model, choose)
    elif model.graph.node:
        change(model.graph, choose)


def _wires(graph: Any) -> list[str]:
    return [name for node in graph.node for name in (*node.input, *node.output)]


def _change_operator(graph: Any, choose: Decisions) -> None:
    choose.pick(graph.node).op_type = choose.pick(_OPERATORS)


def _change_wire(graph: Any, choose: Decisions) -> None:
    node, known = choose.pick(graph.node), [*_wires(graph), "", "nowhere"]
    if node.input and choose.coin():
        node.input[choose.index(len(node.input))] = choose.pick(known)
    else:
        node.input.append(choose.pick(known))


def _change_output(graph: Any, choose: Decisions) -> None:
    node = choose.pick(graph.node)
    if node.output:
        names = ("output", "input", "", "z")
        node.output[choose.index(len(node.output))] = choose.pick(names)


def _leave_out(graph: Any, choose: Decisions) -> None:
    graph.node.remove(choose.pick(graph.node))


def _put_twice(graph: Any, choose: Decisions) -> None:
    graph.node.append(choose.pick(graph.node))


def _change_some_attribute(graph: Any, choose: Decisions) -> None:
    _change_attribute(choose.pick(graph.node), choose)


def _change_attribute(node: Any, choose: Decisions) -> None:
    if node.attribute and choose.coin():
        attribute = choose.pick(node.attribute)
        if attribute.ints:
            attribute.ints[choose.index(len(attribute.ints))] = choose.pick(_NUMBERS)
        elif attribute.type == onnx.AttributeProto.INT:
            attribute.i = choose.pick(_NUMBERS)
        elif attribute.type == onnx.AttributeProto.FLOAT:
            attribute.f = choose.pick((0.0, float("nan"), float("inf"), -1e38, 1e38))
        else:
            attribute.s = choose.pick((b"", b"DCR", b"linear", b"align_corners", b"\xff"))
        return
    name = choose.pick((*_NAMES, *_MORE))
    kept = [attribute for attribute in node.attribute if attribute.name != name]
    values: tuple[Any, ...] = (
        *(choose.pick(_NUMBERS), [choose.pick(_NUMBERS)] * choose.pick((1, 2, 4))),
        *(0.5, "NOTSET", "SAME_UPPER", b"\xff\xfe"),
    )
    del node.attribute[:]
    node.attribute.extend([*kept, helper.make_attribute(name, choose.pick(values))])


def _change_weight(graph: Any, choose: Decisions) -> None:
    if not graph.initializer:
        return
    tensor = choose.pick(graph.initializer)
    try:
        array = numpy_helper.to_array(tensor)
    except (ValueError, TypeError, KeyError):  # changed before
        return
    match choose.index(8):
        case 0:
            array = np.zeros(choose.pick(_SHAPES), array.dtype)
        case 1 if array.ndim:
            axis = choose.index(array.ndim)
            array = np.repeat(array, choose.pick((2, 3, 16)), axis=axis)
        case 2 if array.size:
            array = np.array(array)
            with np.errstate(all="ignore"):
                odd = choose.pick((0.0, 1e38, -1e38, 1e-40, np.nan, np.inf, 1e18))
                array.reshape(-1)[choose.index(array.size)] = np.float64(odd).astype(array.dtype)
        case 3:
            array = array.astype(choose.pick(("f2", "f8", "i4", "i8", "u1", "?")))
        case 4:
            with np.errstate(all="ignore"):
                array = (array * np.float64(choose.pick((0, -1, 1e6, 1e30, 1e-30)))).astype(
                    array.dtype
                )
        case 5:
            tensor.dims[:] = [choose.pick(_NUMBERS) for _ in tensor.dims]
            return
        case 6:
            tensor.name = choose.pick(("input", "output", "", "head", "x"))
            return
        case _:
            tensor.data_type = choose.pick((0, 1, 2, 6, 7, 8, 10, 11, 14, 16, 17, 99))
            return
    tensor.CopyFrom(numpy_helper.from_array(np.ascontiguousarray(array), tensor.name))


def _change_port(model: Any, choose: Decisions) -> None:
    graph = model.graph
    if not (graph.input or graph.output):
        return
    port = choose.pick([*graph.input, *graph.output])
    dims = port.type.tensor_type.shape.dim
    match choose.index(5):
        case 0 if dims:
            dims[choose.index(len(dims))].dim_value = choose.pick(_NUMBERS)
        case 1:
            port.type.tensor_type.elem_type = choose.pick((0, 1, 7, 8, 10, 99))
        case 2:
            port.name = choose.pick(("input", "output", "", "x"))
        case 3 if dims:
            del dims[choose.index(len(dims))]
        case _:
            graph.input.append(port)


def _change_version(model: Any, choose: Decisions) -> None:
    match choose.index(4):
        case 0:
            model.ir_version = choose.pick((0, 1, 3, 8, 11, 2**40, -1))
        case 1 if model.opset_import:
            model.opset_import[0].version = choose.pick((0, 1, 13, 17, 19, 20, 21, 99, -1))
        case 2 if model.opset_import:
            model.opset_import[0].domain = choose.pick(("ai.onnx", "com.microsoft", "x"))
        case _:
            model.opset_import.extend([helper.make_opsetid("", 18)])


def _put_in(graph: Any, choose: Decisions) -> None:
    """Put a node behind the others, its output in place of the graph's."""
    if not graph.node:
        return
    last = graph.node[-1]
    taken = choose.pick([v for n in graph.node for v in n.output] or ["input"])
    if last.output:
        last.output[0] = "before"
        taken = "before" if choose.coin() else taken
    op = choose.pick(_OPERATORS)
    wires = [
        taken,
        *(choose.pick([t.name for t in graph.initializer] or [""]) for _ in range(choose.index(3))),
    ]
    made = helper.make_node(op, wires, ["output"], "put_in")
    for _ in range(choose.index(3)):
        _change_attribute(made, choose)
    graph.node.append(made)


def _lengthen(graph: Any, choose: Decisions) -> None:
    """Put a sound but odd piece behind the last node: wider, further, coarser, finer."""
    last, dims = graph.node[-1], graph.output[0].type.tensor_type.shape.dim
    if not last.output or len(dims) != 4 or not 0 < dims[1].dim_value < 64:
        return
    number, outputs = len(graph.node), dims[1].dim_value
    name = f"odd{number}"
    last.output[0] = f"{name}_0"
    width, kernel = choose.pick(_WIDTHS), choose.pick(_KERNELS)
    if width * kernel * kernel > _MOST_WEIGHTS:
        width = 4
    pieces = [
        ("Conv", (width, outputs, 1, 1), {}),
        choose.pick(
            (
                ("Conv", (width, 1, kernel, kernel), {"pads": [kernel // 2] * 4, "group": width}),
                ("Conv", (width, width, 1, 1), {"pads": [kernel] * 4}),
                (
                    "ConvTranspose",
                    (width, 1, kernel, kernel),
                    {"pads": [kernel // 2] * 4, "group": width},
                ),
                ("AveragePool", None, {"kernel_shape": [kernel] * 2, "pads": [kernel // 2] * 4}),
                ("MaxPool", None, {"kernel_shape": [kernel] * 2, "pads": [kernel // 2] * 4}),
                (
                    "MaxPool",
                    None,
                    {"kernel_shape": [1] * 2, "strides": [choose.pick((2, 3, 64))] * 2},
                ),
                (choose.pick(_UNARY), None, {}),
                ("Softmax", None, {"axis": choose.pick((1, 2, 3, -1, -3))}),
                ("SpaceToDepth", None, {"blocksize": choose.pick((1, 2, 3, 32))}),
                ("GlobalAveragePool", None, {}),
            )
        ),
        choose.pick(
            (
                ("Identity", None, {}),
                ("DepthToSpace", None, {"blocksize": choose.pick((1, 2, 3, 32))}),
                ("ConvTranspose", (width, width, 2, 2), {"strides": [2, 2]}),
                (choose.pick(_UNARY), None, {}),
            )
        ),
        ("Conv", (outputs, width, 1, 1), {}),
    ]
    rng = np.random.default_rng(choose.index(256))
    for index, (op, shape, attributes) in enumerate(pieces):
        wires = [f"{name}_{index}"]
        if shape is not None:
            if np.prod(shape) > _MOST_WEIGHTS:
                return
            weight = rng.uniform(-1, 1, shape).astype(np.float32) / np.float32(np.prod(shape[1:]))
            wires.append(f"{name}_w{index}")
            graph.initializer.append(numpy_helper.from_array(weight, wires[1]))
        end = "output" if index + 1 == len(pieces) else f"{name}_{index + 1}"
        graph.node.append(helper.make_node(op, wires, [end], f"{name}_n{index}", **attributes))


_CHANGES: Final[tuple[Callable[[Any, Decisions], None], ...]] = (
    *(_change_operator, _change_some_attribute, _change_some_attribute, _change_wire),
    *(_change_output, _leave_out, _put_twice, _change_weight, _change_weight),
    *(_change_port, _change_version, _put_in, _lengthen, _lengthen, _lengthen),
)
