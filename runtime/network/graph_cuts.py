"""A network cut into segments, each of which reaches only a few rows.

    nodes in order of computation
    |--------- 0 ---------|--- 1 ---|----- 2 -----|------- 3 -------|
    head .. first halving   second    deepest       up .. output
    half size               quarter   eighth        half size

A segment run on a strip of rows computes its reach to either side for nothing, and what crosses a
cut is copied. The cuts are those of the least work for strips of a usual height.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Final

from camkit.runtime.network.activation_memory import (
    Activations,
    activation_memory,
    tensor_names,
)
from camkit.runtime.network.graph import Graph, parse_graph, partial_model
from camkit.runtime.network.graph_walk import Walk, walk_nodes
from camkit.runtime.network.operators import ELEMENTWISE, Node
from camkit.runtime.network.segment import Feed, Port, Segment

STRIP_PX: Final = 128
"""Height of a strip that the cuts are made for."""
_FLOAT_BYTES: Final = 4
_KEEPS_BLOCKS: Final = ELEMENTWISE | {"MaxPool", "AveragePool", "Resize", "Concat"}
"""Operators that onnxruntime may compute on blocked channels."""
_MOST_GROUPS: Final = 16
"""Groups of nodes that a segment may have."""
_COPY_WORK: Final = 60.0
"""Multiply-accumulates that take as long as copying one sample to or from a cut (measured)."""
_TOUCH_WORK: Final = 30.0
"""Likewise of a node that writes one."""
_SHUFFLE_WORK: Final = 240.0
"""Likewise of one that DepthToSpace of onnxruntime puts to its place."""
_CALL_WORK: Final = 20.0
"""Likewise for a pixel of a strip, of calling a segment."""


def cut_network(data: bytes) -> tuple[Segment, ...]:
    """Cut a network into segments.

    Args:
        data: The ONNX model.

    Returns:
        In the order of computation; none if it looks at the whole picture, or its tensors do not
        lie on the lattice of its pixels.

    Raises:
        BundleError: If the model is not admissible.
    """
    graph = parse_graph(data)
    graph = replace(graph, nodes=_sliced_late(graph.nodes))
    walk = walk_nodes(graph.nodes, graph.constants, (graph.input_name, graph.input_channels))
    axes = [extent.axes for extent in walk.extents.values()]
    if walk.global_operators or any(one is None or one[0].step != one[1].step for one in axes):
        return ()
    cuts = _Cuts(graph, walk)
    places = cuts.best()
    return tuple(cuts.segment(data, first, end) for first, end in places)


def _sliced_late(nodes: Sequence[Node]) -> tuple[Node, ...]:
    """Return the nodes with every Slice right before its first reader."""
    late = list(nodes)
    for node in reversed(nodes):
        if node.op == "Slice":
            late.remove(node)
            uses = (i for i, other in enumerate(late) if node.outputs[0] in other.inputs)
            late.insert(next(uses, len(late)), node)
    return tuple(late)


class _Cuts:
    """The ways to cut one network."""

    def __init__(self, graph: Graph, walk: Walk) -> None:
        self._graph, self._walk = graph, walk
        self._nodes = graph.nodes
        self._last_use = {name: i for i, node in enumerate(self._nodes) for name in node.inputs}
        self._last_use[graph.output_name] = len(self._nodes)
        self._maker = {name: i for i, node in enumerate(self._nodes) for name in node.outputs}
        self._blocked = set(walk.blocked)
        for node in self._nodes:
            names = tensor_names(walk.extents, node.inputs)
            if node.op in _KEEPS_BLOCKS and self._blocked.issuperset(names):
                self._blocked.update(node.outputs)

    def best(self) -> list[tuple[int, int]]:
        """Return first and end of the nodes of every segment, of the least work in all."""
        places = [i for i in range(len(self._nodes) + 1) if self._may_cut(i)]
        least: dict[int, tuple[float, int]] = {0: (0.0, 0)}
        for j, end in enumerate(places[1:], start=1):
            ways = (
                (least[first][0] + self._work(first, end), first)
                for first in places[max(0, j - _MOST_GROUPS) : j]
            )
            least[end] = min(ways)
        runs, end = [], places[-1]
        while end:
            first = least[end][1]
            runs.append((first, end))
            end = first
        return runs[::-1]

    def segment(self, data: bytes, first: int, end: int) -> Segment:
        """Return the segment of some nodes."""
        feeds = tuple(self._feeds(first, end))
        outputs = tuple(map(self._port, self._names_out(first, end)))
        lattice_px, reach_px = self._reach(first, end)
        fed = {feed.name for feed in feeds}
        return Segment(
            model=partial_model(
                data,
                {name for node in self._nodes[first:end] for name in node.outputs} - fed,
                [(feed.name, feed.channels) for feed in feeds],
                [(port.name, port.channels) for port in outputs],
            ),
            feeds=feeds,
            outputs=outputs,
            lattice_px=lattice_px,
            reach_px=reach_px,
            strip_bytes=self._strip_bytes(first, end, fed),
            held_bytes=_FLOAT_BYTES * self._samples([port.name for port in outputs]),
            mac_per_pixel=sum(map(self._mac, self._nodes[first:end])),
        )

    def _may_cut(self, place: int) -> bool:
        """Return whether nodes may be parted in front of one: never those computed as one."""
        if place in (0, len(self._nodes)):
            return True
        crossing = set(self._crossing(place))
        if not crossing.isdisjoint(self._walk.booleans):
            return False
        whole = all(
            axis.extra == 0 for name in crossing for axis in self._walk.extents[name].axes or ()
        )
        return whole and not any(self._is_fused(node, crossing) for node in self._nodes[place:])

    def _is_fused(self, node: Node, crossing: set[str]) -> bool:
        """Return whether onnxruntime computes a node along with what comes in over a cut.

        Its sums of blocked tensors are taken in the convolution of one of them, in other bits.
        """
        names = tensor_names(self._walk.extents, node.inputs)
        return (
            node.op in ELEMENTWISE
            and not crossing.isdisjoint(names)
            and all(name in self._blocked for name in names)
        )

    def _crossing(self, place: int) -> Iterator[str]:
        """Yield the tensors that are made before a place and used from it on."""
        for name in self._walk.extents:
            if self._maker.get(name, -1) < place <= self._last_use.get(name, -1):
                yield name

    def _feeds(self, first: int, end: int) -> Iterator[Feed]:
        """Yield the inputs of a segment; a DepthToSpace of one is done on the way to it."""
        names = self._names_in(first, end)
        nodes = self._nodes[first:end]
        for name in names:
            readers = [node for node in self._nodes if name in node.inputs]
            shuffle = next((node for node in nodes if name in node.inputs), None)
            if shuffle is not None and self._is_fed(shuffle, readers, end):
                yield Feed(
                    port=self._port(name),
                    name=shuffle.outputs[0],
                    block=shuffle.integer("blocksize", 1),
                    depth_first=shuffle.text("mode", "DCR") == "DCR",
                )
            else:
                yield Feed(port=self._port(name), name=name)

    def _is_fed(self, node: Node, readers: Sequence[Node], end: int) -> bool:
        """Return whether a DepthToSpace can be done on the way to the segment that needs it."""
        inside = self._last_use.get(node.outputs[0], end) < end
        return node.op == "DepthToSpace" and len(readers) == 1 and inside

    def _names_in(self, first: int, end: int) -> list[str]:
        """Return the tensors from outside that some nodes take."""
        inputs = dict.fromkeys(
            name
            for node in self._nodes[first:end]
            for name in tensor_names(self._walk.extents, node.inputs)
        )
        return [name for name in inputs if self._maker.get(name, -1) < first]

    def _names_out(self, first: int, end: int) -> list[str]:
        outputs = (name for node in self._nodes[first:end] for name in node.outputs)
        return [name for name in outputs if self._last_use.get(name, -1) >= end]

    def _port(self, name: str) -> Port:
        extent = self._walk.extents[name]
        step = extent.axes[0].step if extent.axes else Fraction(1)
        return Port(name=name, channels=extent.channels, step=step)

    def _samples(self, names: Sequence[str]) -> float:
        return sum(self._walk.extents[name].samples_per_pixel for name in names)

    def _work(self, first: int, end: int) -> float:
        """Return the work of a segment for a pixel, in multiply-accumulates."""
        _, reach_px = self._reach(first, end)
        fed = {feed.name for feed in self._feeds(first, end)}
        nodes = [node for node in self._nodes[first:end] if node.outputs[0] not in fed]
        work = sum(map(self._node_work, nodes)) * (1 + 2 * reach_px / STRIP_PX)
        crossing = [*self._names_in(first, end), *self._names_out(first, end)]
        return work + _COPY_WORK * self._samples(crossing) + _CALL_WORK

    def _node_work(self, node: Node) -> float:
        samples = self._samples(node.outputs)
        if node.op == "DepthToSpace":
            return _SHUFFLE_WORK * samples
        return self._mac(node) + _TOUCH_WORK * samples

    def _mac(self, node: Node) -> float:
        if node.op not in ("Conv", "ConvTranspose"):
            return 0.0
        name = node.outputs[0] if node.op == "Conv" else node.inputs[0]
        extent = self._walk.extents[name]
        weights = self._graph.constants[node.inputs[1]].size
        return weights * extent.samples_per_pixel / extent.channels

    def _reach(self, first: int, end: int) -> tuple[int, int]:
        """Return lattice and reach of a segment in pixels."""
        nodes = self._nodes[first:end]
        names = [*self._names_in(first, end), *(name for node in nodes for name in node.outputs)]
        lattice = math.lcm(*(self._port(name).step.numerator for name in names))
        reach = max(self._reach_along(axis, first, end, lattice) for axis in range(2))
        return lattice, -(-math.ceil(reach) // lattice) * lattice

    def _reach_along(self, axis: int, first: int, end: int, lattice_px: int) -> Fraction:
        """Return how far a segment looks beyond a cell of its lattice along rows or columns."""
        runs = {
            name: (0, self._port(name).samples(lattice_px) - 1)
            for name in self._names_out(first, end)
        }
        for node in reversed(self._nodes[first:end]):
            for output in node.outputs:
                if output not in runs:
                    continue
                run = runs[output]
                if output in self._walk.windows:
                    run = self._walk.windows[output][axis].reads(*run)
                for name in tensor_names(self._walk.extents, node.inputs):
                    old = runs.get(name, run)
                    runs[name] = min(old[0], run[0]), max(old[1], run[1])
        reach = Fraction(0)
        for name in self._names_in(first, end):
            step = self._port(name).step
            low, high = runs.get(name, (0, -1))
            reach = max(reach, -low * step, (high + 1) * step - lattice_px)
        return reach

    def _strip_bytes(self, first: int, end: int, fed: set[str]) -> float:
        walk = self._walk
        nodes = [node for node in self._nodes[first:end] if node.outputs[0] not in fed]
        memory = activation_memory(
            nodes,
            Activations(extents=walk.extents, workspace=walk.workspace, blocked=walk.blocked),
            ends=(nodes[0].inputs[0], nodes[-1].outputs[0]),
        )
        crossing = [*self._names_in(first, end), *self._names_out(first, end)]
        return memory.block + _FLOAT_BYTES * self._samples(crossing)
