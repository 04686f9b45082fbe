"""Means over the whole picture: frozen to constants, or taken in windows around every pixel.

    constants   the mean of what calibration pictures give, whatever the picture
    local:N     means of N x N pixels around (test-time local converter), on cells of at most 16 px

References: Chu et al. 2022, Improving image restoration by revisiting global information
aggregation (TLC).
"""

from collections.abc import Iterable
from typing import Any, Final

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from camkit.arrays import FloatArray
from camkit.errors import BundleError
from camkit.export.foreign.canonical import canonical_graph
from camkit.export.foreign.onnx_file import foreign_model
from camkit.runtime.network.engine import tensor_values
from camkit.runtime.network.graph import inspect_graph, parse_graph
from camkit.runtime.network.graph_walk import Walk, walk_nodes
from camkit.runtime.network.operators import Node, reduced_axes, reduces_space

LOCAL_CELL_PX: Final = 16
"""Side of the cells on which local means are taken, in pixels of the network's input."""
_LEAST_CELLS: Final = 4
"""Fewer cells than these along a window are not worth their coarseness."""
_MEANS: Final = ("GlobalAveragePool", "ReduceMean")


def with_constants(data: bytes, windows: Iterable[FloatArray]) -> bytes:
    """Return a network whose statistics of the whole picture are constants.

    Args:
        data: A canonical graph.
        windows: (1, channels, h, w) inputs of calibration pictures, whole.

    Raises:
        BundleError: If one of them cannot be frozen.
    """
    names = {node.label: node.outputs[0] for node in _global_nodes(data)}
    probe = onnx.load_from_string(data)
    del probe.graph.output[:]
    probe.graph.output.extend(onnx.ValueInfoProto(name=name) for name in names.values())
    sums: dict[str, Any] = {}
    count = 0
    for window in windows:
        values = tensor_values(probe.SerializeToString(), list(names.values()), {"input": window})
        for name, value in values.items():
            sums[name] = sums.get(name, 0.0) + value.astype(np.float64)
        count += 1
    proto = onnx.load_from_string(data)
    remaining = [node for node in proto.graph.node if node.name not in names]
    del proto.graph.node[:]
    proto.graph.node.extend(remaining)
    proto.graph.initializer.extend(
        numpy_helper.from_array((value / count).astype(np.float32), name)
        for name, value in sums.items()
    )
    return _refolded(proto)


def with_local_means(data: bytes, side_px: int) -> bytes:
    """Return a network whose means of the whole picture are means of windows.

    Args:
        data: A canonical graph.
        side_px: Of a window, in pixels of the network's input.

    Raises:
        BundleError: If it takes another statistic than a mean.
    """
    proto = onnx.load_from_string(data)
    graph = parse_graph(data)
    walk = walk_nodes(graph.nodes, graph.constants, (graph.input_name, graph.input_channels))
    places = {node.label: node for node in _global_nodes(data)}
    nodes: list[Any] = []
    for proto_node in proto.graph.node:
        if proto_node.name not in places:
            nodes.append(proto_node)
            continue
        nodes += _local_mean(proto, places[proto_node.name], walk, side_px)
    del proto.graph.node[:]
    proto.graph.node.extend(nodes)
    return _refolded(proto)


def with_residual(data: bytes, channels: tuple[int, ...], *, subtracted: bool) -> bytes:
    """Return a network that gives its last plane plus, or minus, what it gave.

    Args:
        data: A canonical graph.
        channels: Of the planes that it takes; what lies behind them is no plane.
        subtracted: Whether it gave what is too much.
    """
    proto = onnx.load_from_string(data)
    graph = proto.graph
    first, end = sum(channels[:-1]), sum(channels)
    for node in graph.node:
        for names in (node.input, node.output):
            for place, name in enumerate(names):
                if name == "output":
                    names[place] = "residual"
    bounds = [("first", first), ("end", end), ("axis", 1)]
    names = [f"residual_{name}" for name, _ in bounds]
    graph.initializer.extend(
        numpy_helper.from_array(np.array([value], np.int64), name)
        for name, (_, value) in zip(names, bounds, strict=True)
    )
    whole = first == 0 and end == graph.input[0].type.tensor_type.shape.dim[1].dim_value
    plane = "input" if whole else "residual_plane"
    if not whole:
        graph.node.append(helper.make_node("Slice", ["input", *names], [plane], name=plane))
    op = "Sub" if subtracted else "Add"
    graph.node.append(helper.make_node(op, [plane, "residual"], ["output"], name="restored"))
    return _refolded(proto)


def _global_nodes(data: bytes) -> list[Node]:
    """Return the nodes that look at the whole picture.

    Raises:
        BundleError: If one does so in another way than by a statistic.
    """
    facts, graph = inspect_graph(data), parse_graph(data)
    labels = {text.rsplit(" (", 1)[0] for text in facts.global_operators}
    nodes = [node for node in graph.nodes if node.label in labels]
    for node in nodes:
        if node.op in ("Resize", "Softmax") or not node.op.startswith(("Reduce", "Global")):
            raise BundleError(
                f"{node.label}: {node.op} depends on the size of the whole picture; only means, "
                "sums and extremes over it can be frozen or made local"
            )
    return nodes


def _local_mean(proto: Any, node: Node, walk: Walk, side_px: int) -> list[Any]:
    extent, name = walk.extents[node.inputs[0]], node.outputs[0]
    axes = reduced_axes(node, walk.constants) if node.op == "ReduceMean" else frozenset({2, 3})
    if node.op not in _MEANS or axes != {2, 3} or extent.axes is None:
        raise BundleError(f"{node.label}: a {node.op} over axes {sorted(axes)} has no local mean")
    assert reduces_space(axes)
    step = extent.axes[0].step
    cell = max(1, LOCAL_CELL_PX // max(1, int(step)))
    if side_px < _LEAST_CELLS * cell * step:
        cell = 1
    count = max(1, round(side_px / float(step * cell)) // 2 * 2 + 1)
    nodes, source = [], node.inputs[0]
    if cell > 1:
        source = f"{name}_cells"
        nodes.append(_pool(node.inputs[0], source, (cell, cell), strides=[cell, cell]))
    wide = f"{name}_rows"
    nodes.append(_pool(source, wide, (count, 1)))
    last = f"{name}_means" if cell > 1 else name
    nodes.append(_pool(wide, last, (1, count)))
    if cell > 1:
        scales = f"{name}_scales"
        proto.graph.initializer.append(
            numpy_helper.from_array(np.array([1, 1, cell, cell], np.float32), scales)
        )
        nodes.append(
            helper.make_node(
                "Resize",
                [last, "", scales],
                [name],
                name=f"{name}_fine",
                mode="linear",
                coordinate_transformation_mode="half_pixel",
            )
        )
    return nodes


def _pool(source: str, result: str, kernel: tuple[int, int], **facts: Any) -> Any:
    """Return a mean that leaves out what lies beyond the picture."""
    pads = [0] * 4 if facts else [kernel[0] // 2, kernel[1] // 2] * 2
    return helper.make_node(
        "AveragePool",
        [source],
        [result],
        name=result,
        kernel_shape=list(kernel),
        pads=pads,
        count_include_pad=0,
        **facts,
    )


def _refolded(proto: Any) -> bytes:
    """Return a changed canonical graph in canonical form again."""
    outputs = proto.graph.output[0].type.tensor_type.elem_type
    assert outputs == TensorProto.FLOAT
    return canonical_graph(foreign_model(proto)).model
