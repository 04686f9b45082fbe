"""A builder of ONNX graphs: values that add and multiply, constants, and tables that graphs share.

    graph = GraphBuilder("tile")
    x = graph.input("planes", (1, 6, "h", "w"))
    graph.output("out", (x * 2 + graph.table("fall", fall)).relu(), (1, 6, "h", "w"))
    graph.to_bytes()

A table is an input of the graph; its numbers lie in one file beside the graphs.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

OPSET: Final = 18
IR_VERSION: Final = 9
Operand = "Value | float | NDArray[Any]"
Shape = Sequence[int | str]
TYPES: Final = {
    "float32": TensorProto.FLOAT,
    "float64": TensorProto.DOUBLE,
    "int64": TensorProto.INT64,
}


class Value:
    """A value of a graph; numbers and arrays beside it become constants of its type."""

    __array_ufunc__ = None  # arrays leave operators to the value beside them

    def __init__(self, graph: "GraphBuilder", name: str, kind: str = "float32") -> None:
        self.graph = graph
        self.name = name
        self.kind = kind

    def _operate(self, operator: str, *others: Any, **attributes: Any) -> "Value":
        return self.graph.node(operator, self, *others, **attributes)

    def __add__(self, other: Any) -> "Value":
        return self._operate("Add", other)

    def __mul__(self, other: Any) -> "Value":
        return self._operate("Mul", other)

    def __sub__(self, other: Any) -> "Value":
        return self._operate("Sub", other)

    def __truediv__(self, other: Any) -> "Value":
        return self._operate("Div", other)

    def __matmul__(self, other: Any) -> "Value":
        return self._operate("MatMul", other)

    def __pow__(self, other: Any) -> "Value":
        return self._operate("Pow", other)

    def __gt__(self, other: Any) -> "Value":
        return Value(self.graph, self._operate("Greater", other).name, "bool")

    def __lt__(self, other: Any) -> "Value":
        return Value(self.graph, self._operate("Less", other).name, "bool")

    __radd__ = __add__
    __rmul__ = __mul__

    def __rsub__(self, other: float) -> "Value":
        return self.graph.constant(other, self.kind) - self

    def __rtruediv__(self, other: float) -> "Value":
        if other == 1:
            return self._operate("Reciprocal")
        return self.graph.constant(other, self.kind) / self

    def __rmatmul__(self, other: NDArray[Any]) -> "Value":
        return self.graph.constant(other, self.kind) @ self

    def relu(self) -> "Value":
        """Return what lies above 0, else 0."""
        return self._operate("Relu")

    def sqrt(self) -> "Value":
        """Return the square root."""
        return self._operate("Sqrt")

    def at_least(self, least: Any) -> "Value":
        """Return the larger of two."""
        return self._operate("Max", least)

    def at_most(self, most: Any) -> "Value":
        """Return the smaller of two."""
        return self._operate("Min", most)

    def clip(self, least: float, most: float) -> "Value":
        """Return the value within two numbers."""
        return self._operate("Clip", least, most)

    def floor(self) -> "Value":
        """Return the largest whole number that is not above it."""
        return self._operate("Floor")

    def shaped(self, *shape: int) -> "Value":
        """Return the same samples in another shape."""
        return self._operate("Reshape", np.array(shape, np.int64))

    def turned(self, *axes: int) -> "Value":
        """Return the axes in another order."""
        return self._operate("Transpose", perm=list(axes))

    def sum(self, *axes: int) -> "Value":
        """Return the sum over some axes, which stay with a length of one."""
        return self._operate("ReduceSum", np.array(axes, np.int64), keepdims=1)

    def part(self, axis: int, start: int, stop: int, step: int = 1) -> "Value":
        """Return some samples along an axis."""
        numbers = (np.array([number], np.int64) for number in (start, stop, axis, step))
        return self._operate("Slice", *numbers)

    def parts(self, axis: int, count: int) -> "list[Value]":
        """Return equal parts along an axis."""
        return self.graph.nodes_out("Split", (self,), count, axis=axis, num_outputs=count)

    def gather(self, index: Any, axis: int) -> "Value":
        """Return the samples of these numbers along an axis."""
        return self._operate("Gather", index, axis=axis)

    def cast(self, kind: str) -> "Value":
        """Return the value as float32, float64 or int64."""
        output = self._operate("Cast", to=TYPES[kind])
        return Value(self.graph, output.name, kind)


class GraphBuilder:
    """A graph that grows node by node."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.tables: dict[str, NDArray[np.float32]] = {}
        self._nodes: list[onnx.NodeProto] = []
        self._initializers: dict[tuple[Any, ...], str] = {}
        self._tensors: list[TensorProto] = []
        self._inputs: dict[str, onnx.ValueInfoProto] = {}
        self._outputs: dict[str, onnx.ValueInfoProto] = {}

    @property
    def inputs(self) -> list[str]:
        """Return the names of the inputs that are no tables."""
        return [name for name in self._inputs if name not in self.tables]

    @property
    def outputs(self) -> list[str]:
        """Return the names of the outputs."""
        return list(self._outputs)

    def input(self, name: str, shape: Shape, kind: str = "float32") -> Value:
        """Return a new input."""
        self._inputs[name] = helper.make_tensor_value_info(name, TYPES[kind], list(shape))
        return Value(self, name, kind)

    def table(self, name: str, values: NDArray[Any]) -> Value:
        """Return a table: an input whose float32 numbers lie beside the graphs."""
        values_before = self.tables.get(name)
        assert values_before is None or np.array_equal(values_before, np.float32(values)), (
            f"two tables {name}"
        )
        if values_before is None:
            self.tables[name] = np.ascontiguousarray(values, np.float32)
            self.input(name, values.shape)
        return Value(self, name)

    def constant(self, values: Any, kind: str = "float32") -> Value:
        """Return a constant; equal ones are stored once."""
        array = np.asarray(values)
        if array.dtype != np.bool_ and not np.issubdtype(array.dtype, np.integer):
            array = array.astype(kind if kind != "int64" else "float32")
        elif isinstance(values, int):
            array = array.astype(kind)
        key = (array.dtype.str, array.shape, array.tobytes())
        if key not in self._initializers:
            name = f"c{len(self._tensors)}"
            self._tensors.append(numpy_helper.from_array(np.ascontiguousarray(array), name))
            self._initializers[key] = name
        return Value(self, self._initializers[key], str(array.dtype))

    def node(self, operator: str, *inputs: Any, **attributes: Any) -> Value:
        """Return the one output of a new node."""
        return self.nodes_out(operator, inputs, 1, **attributes)[0]

    def nodes_out(
        self, operator: str, inputs: Sequence[Any], count: int, **attributes: Any
    ) -> list[Value]:
        """Return the outputs of a new node."""
        kinds = [one.kind for one in inputs if isinstance(one, Value)]
        kind = next((one for one in kinds if one != "bool"), "float32")
        names = [self._name_of(one, kind) for one in inputs]
        outputs = [f"v{len(self._nodes)}_{number}" for number in range(count)]
        self._nodes.append(helper.make_node(operator, names, outputs, **attributes))
        return [Value(self, name, kind) for name in outputs]

    def joined(self, values: Sequence[Value], axis: int) -> Value:
        """Return values one behind the other along an axis."""
        return self.node("Concat", *values, axis=axis)

    def copied(self, network: onnx.ModelProto, planes: Value) -> Value:
        """Return what a network of one input and one output makes of planes."""
        graph = network.graph
        names = {graph.input[0].name: planes.name, "": ""}
        for tensor in graph.initializer:
            copy = TensorProto()
            copy.CopyFrom(tensor)
            copy.name = names[tensor.name] = f"net_{tensor.name}"
            self._tensors.append(copy)
        for node in graph.node:
            copy = onnx.NodeProto()
            copy.CopyFrom(node)
            for i, name in enumerate(copy.output):
                copy.output[i] = names[name] = f"net_{name}"
            for i, name in enumerate(copy.input):
                copy.input[i] = names[name]
            self._nodes.append(copy)
        return Value(self, names[graph.output[0].name])

    def output(self, name: str, value: Value, shape: Shape) -> None:
        """Add an output."""
        self._nodes.append(helper.make_node("Identity", [value.name], [name]))
        self._outputs[name] = helper.make_tensor_value_info(name, TYPES[value.kind], list(shape))

    def to_bytes(self) -> bytes:
        """Return the checked model.

        Raises:
            onnx.checker.ValidationError: If the graph breaks the rules of the opset.
        """
        graph = helper.make_graph(
            self._nodes,
            self.name,
            list(self._inputs.values()),
            list(self._outputs.values()),
            self._tensors,
        )
        opsets = [helper.make_opsetid("", OPSET)]
        model = helper.make_model(graph, opset_imports=opsets, ir_version=IR_VERSION)
        onnx.checker.check_model(model)
        return bytes(model.SerializeToString())

    def _name_of(self, one: Any, kind: str) -> str:
        if one is None:
            return ""
        return one.name if isinstance(one, Value) else self.constant(one, kind).name


def shared_tables(graphs: Sequence[GraphBuilder]) -> Mapping[str, NDArray[np.float32]]:
    """Return the tables of all graphs; a name stands for the same numbers in each."""
    tables: dict[str, NDArray[np.float32]] = {}
    for graph in graphs:
        for name, values in graph.tables.items():
            values_before = tables.setdefault(name, values)
            assert np.array_equal(values_before, values), f"table {name} differs between graphs"
    return tables
