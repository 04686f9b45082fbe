"""A network's nodes while they are rewritten."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import helper

Array = NDArray[Any]
Shape = tuple[int, ...]


@dataclass(slots=True, kw_only=True)
class Draft:
    """A graph between two forms.

    Attributes:
        nodes: In the order of computation.
        constants: By name.
        moving: What depends on the size of the picture alone: its values at two sizes.
        shapes: Of the tensors, at these two sizes.
        source: Name of the input.
        target: Name of the output.
        opset: By which the nodes are read.
    """

    nodes: list[Any]
    constants: dict[str, Array]
    moving: dict[str, tuple[Array, Array]]
    shapes: dict[str, tuple[Shape, Shape]]
    source: str
    target: str
    opset: int
    _count: int = field(default=0)

    def constant(self, values: Any) -> str:
        """Add a constant; return its name."""
        self._count += 1
        name = f"constant_{self._count}"
        self.constants[name] = np.asarray(values)
        return name

    def name(self, stem: str) -> str:
        """Return a new name for a tensor."""
        self._count += 1
        return f"{stem}_{self._count}"

    def readers(self, name: str) -> list[Any]:
        """Return the nodes that read a tensor."""
        return [node for node in self.nodes if name in node.input]

    def only_reader(self, name: str) -> Any:
        """Return the one node that reads a tensor; None where others do, or the caller."""
        readers = self.readers(name)
        return readers[0] if len(readers) == 1 and name != self.target else None

    def replace(self, old: Iterable[Any], new: Iterable[Any]) -> None:
        """Write nodes in the place of the last of some others."""
        old_nodes = list(old)
        place = max(self.nodes.index(node) for node in old_nodes)
        self.nodes[place + 1 : place + 1] = list(new)
        for node in old_nodes:
            self.nodes.remove(node)

    def bypass(self, node: Any) -> None:
        """Remove a node that gives its first input as it is."""
        source, result = node.input[0], node.output[0]
        self.nodes.remove(node)
        if result == self.target:
            self._rename(source, result)
            return
        for other in self.nodes:
            for place, name in enumerate(other.input):
                if name == result:
                    other.input[place] = source

    def _rename(self, old: str, new: str) -> None:
        """Rename the tensor `old` to that of the output, unless it is the input."""
        if old == self.source or old in self.constants:
            self.nodes.append(make_node("Identity", [old], new))
            return
        for node in self.nodes:
            for names in (node.input, node.output):
                for place, name in enumerate(names):
                    if name == old:
                        names[place] = new

    def prune(self) -> None:
        """Remove nodes and constants that lead nowhere."""
        names_read, remaining = {self.target}, []
        for node in reversed(self.nodes):
            if names_read.intersection(node.output):
                names_read.update(name for name in node.input if name)
                remaining.append(node)
        self.nodes = remaining[::-1]
        self.constants = {name: a for name, a in self.constants.items() if name in names_read}
        self.moving = {name: a for name, a in self.moving.items() if name in names_read}

    def channels(self, name: str) -> int:
        """Return the channels of a tensor."""
        return self.shapes[name][0][1]


def make_node(op: str, inputs: list[str], output: str, **attributes: Any) -> Any:
    """Return a node with one output."""
    return helper.make_node(op, inputs, [output], **attributes)


def attributes_of(node: Any) -> dict[str, Any]:
    """Return the attributes of a node; words as text."""
    values = {a.name: helper.get_attribute_value(a) for a in node.attribute}
    return {k: v.decode() if isinstance(v, bytes) else v for k, v in values.items()}


def scalar(constants: Mapping[str, Array], name: str) -> float | None:
    """Return a constant of one number; None for any other tensor."""
    values = constants.get(name)
    return float(values.ravel()[0]) if values is not None and values.size == 1 else None
