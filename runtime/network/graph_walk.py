"""The walk along the nodes of a network: reach, stride, cost, and what breaks exact tiling.

Forwards, each tensor gets its channels and its grid; backwards, the pixels that a run of output
pixels reads are carried from the output to the input in integers.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from camkit.errors import BundleError
from camkit.runtime.network.activation_memory import (
    Activations,
    activation_memory,
    tensor_names,
)
from camkit.runtime.network.operators import (
    COMPARISONS,
    ELEMENTWISE,
    GLOBAL_POOLS,
    NORMALIZATIONS,
    REDUCTIONS,
    Axis,
    Constants,
    Extent,
    Node,
    Windows,
    check_broadcast,
    check_extents,
    convolution_windows,
    is_corner_aligned,
    pad_windows,
    place_run,
    reduced_axes,
    reduces_space,
    resize_windows,
    shuffle_window,
    unshuffle_window,
)

# The alignment of onnxruntime's blocked (NCHWc) convolutions, and the channels below which it
# reads the plain layout into a blocked one; the block is 8 or 16 by processor.
_BLOCK_ALIGNMENT: Final = 4
_SMALL_INPUT: Final = 8
_LARGE_BLOCK: Final = 16
# How much longer a sample takes that is pooled, or multiplied in groups or off the blocked path.
_SLOWNESS: Final = 16
_CHANNEL_AXIS: Final = 1
# Operators that may take several computed tensors; all others take one, the rest is constant.
_FLOATS: Final = (1, 10)  # of TensorProto.DataType: float32 and float16
_FREE: Final = (
    frozenset({"Add", "Sub", "Mul", "Div", "Max", "Min", "Concat", "Where"}) | COMPARISONS
)


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphFacts:
    """The facts that follow from the graph of a network.

    Attributes:
        output_scale: Samples along a side of the output for one pixel of the input.
        receptive_field_radius_px: How far a window on the lattice of the stride must reach past
            the pixels it keeps, apart from what passes through `global_operators`.
        stride_px: Height and width must be multiples of it.
        global_operators: "name (type)" of nodes that see the whole picture.
        unblocked_convolutions: Nodes off onnxruntime's blocked path; bits of tiled and whole
            may differ there.
        mac_per_pixel: Multiply-accumulates of all convolutions per pixel of the input.
        bytes_per_pixel: Peak of the live float32 activations per pixel of the input.
        block_bytes_per_pixel: What a run takes that lays them in one block.
        work_per_pixel: Multiply-accumulates, those of pooling, of groups and off the blocked path
            several times, as slow as they are; samples read and written.
        parameters: Number of constants of floating point.
        values_per_pixel: Samples of all tensors together.
    """

    input_name: str
    input_channels: int
    output_name: str
    output_channels: int
    output_scale: int
    receptive_field_radius_px: int
    stride_px: int
    global_operators: tuple[str, ...]
    unblocked_convolutions: tuple[str, ...]
    mac_per_pixel: float
    bytes_per_pixel: float
    block_bytes_per_pixel: float
    work_per_pixel: float
    parameters: int
    values_per_pixel: float


@dataclass(slots=True, kw_only=True)
class Walk:
    """The tensors of a graph, and what was found on the way through it.

    Attributes:
        constants: By name.
        extents: Tensor -> channels and grid.
        windows: Output of a node -> the samples that it reads, rows and columns.
        global_operators: "name (type)" of nodes that see the whole picture.
        unblocked: Convolutions off onnxruntime's blocked path.
        blocked: Outputs of those on it.
        booleans: Outputs of comparisons.
        workspace: Output of a node -> values per pixel that it needs besides.
        mac_per_pixel: Multiply-accumulates.
        slow_per_pixel: Those of pooling, of groups and off the blocked path.
    """

    constants: Constants
    extents: dict[str, Extent]
    windows: dict[str, Windows] = field(default_factory=dict)
    global_operators: list[str] = field(default_factory=list)
    unblocked: list[str] = field(default_factory=list)
    blocked: set[str] = field(default_factory=set)
    booleans: set[str] = field(default_factory=set)
    workspace: dict[str, float] = field(default_factory=dict)
    mac_per_pixel: float = 0.0
    slow_per_pixel: float = 0.0

    def extent(self, node: Node, index: int = 0) -> Extent:
        """Return the extent of an input of a node."""
        name = node.inputs[index] if index < len(node.inputs) else ""
        if name not in self.extents:
            raise BundleError(f"{node.label}: input {name!r} is not computed before it is used")
        return self.extents[name]

    def constant_shape(self, node: Node, index: int) -> tuple[int, ...]:
        """Return the shape of an input that must be a constant."""
        name = node.inputs[index] if index < len(node.inputs) else ""
        if name not in self.constants:
            raise BundleError(f"{node.label}: input {index} must be a constant")
        return self.constants[name].shape

    def integers(self, node: Node, index: int) -> list[int]:
        """Return an input that must be constant integers."""
        self.constant_shape(node, index)
        values = self.constants[node.inputs[index]]
        if values.dtype.kind not in "iu":
            raise BundleError(f"{node.label}: input {index} must be integers; got {values.dtype}")
        return [int(value) for value in values.ravel()]

    def pass_through(self, node: Node, channels: int, windows: Windows) -> Extent:
        """Return the extent behind a node with windows, and remember them for the way back."""
        self.windows[node.outputs[0]] = windows
        return self.extent(node).output_of(channels, windows)

    def mark_global(self, node: Node) -> None:
        """Add a node to those that see the whole picture."""
        self.global_operators.append(f"{node.label} ({node.op})")


def walk_graph(
    nodes: Sequence[Node],
    constants: Constants,
    *,
    source: tuple[str, int],
    target: tuple[str, int | None],
) -> GraphFacts:
    """Walk the nodes in order and return the facts.

    Args:
        nodes: In the order of computation.
        constants: By name.
        source: Name and channels of the input.
        target: Name of the output, and its channels where declared.

    Raises:
        BundleError: If a node cannot be followed, or the output is not a whole number of samples
            per pixel of the input with the declared channels.
    """
    walk = walk_nodes(nodes, constants, source)
    final, scale = _final(walk.extents, target)
    steps = [axis.step for e in walk.extents.values() if e.axes is not None for axis in e.axes]
    stride = math.lcm(*(step.numerator for step in steps))
    values = sum(extent.samples_per_pixel for extent in walk.extents.values())
    read = sum(
        walk.extents[name].samples_per_pixel
        for node in nodes
        for name in tensor_names(walk.extents, node.inputs)
    )
    memory = activation_memory(
        nodes,
        Activations(extents=walk.extents, workspace=walk.workspace, blocked=walk.blocked),
        ends=(source[0], target[0]),
    )
    return GraphFacts(
        input_name=source[0],
        input_channels=source[1],
        output_name=target[0],
        output_channels=final.channels,
        output_scale=scale,
        receptive_field_radius_px=_reach(
            nodes, walk, ends=(source[0], target[0]), samples=(stride, scale)
        ),
        stride_px=stride,
        global_operators=tuple(walk.global_operators),
        unblocked_convolutions=tuple(walk.unblocked),
        mac_per_pixel=walk.mac_per_pixel,
        bytes_per_pixel=memory.live,
        block_bytes_per_pixel=memory.block,
        work_per_pixel=walk.mac_per_pixel + _SLOWNESS * walk.slow_per_pixel + values + read,
        parameters=sum(a.size for a in constants.values() if a.dtype.kind == "f"),
        values_per_pixel=values,
    )


def walk_nodes(nodes: Sequence[Node], constants: Constants, source: tuple[str, int]) -> Walk:
    """Walk the nodes forwards.

    Args:
        nodes: In the order of computation.
        constants: By name.
        source: Name and channels of the input.

    Raises:
        BundleError: If a node cannot be followed.
    """
    start = Extent(channels=source[1], axes=(Axis(), Axis()))
    walk = Walk(constants=constants, extents={source[0]: start})
    for node in nodes:
        extents = _node_extents(walk, node)
        check_extents(node, extents)
        walk.extents.update(zip(node.outputs, extents, strict=False))
    return walk


def _final(extents: Mapping[str, Extent], target: tuple[str, int | None]) -> tuple[Extent, int]:
    """Return the extent of the output, and its samples along a side for one pixel."""
    name, channels = target
    if name not in extents:
        raise BundleError(f"output {name!r} is never computed")
    final = extents[name]
    steps = {axis.step for axis in final.axes or ()}
    exact = all(axis.extra == 0 for axis in final.axes or ())
    if not exact or len(steps) != 1 or next(iter(steps)).numerator != 1:
        raise BundleError(
            f"output {name!r} must have the height and width of the input, or both multiplied by "
            "one whole number"
        )
    if channels is not None and channels != final.channels:
        raise BundleError(
            f"output {name!r} declares {channels} channels, the graph computes {final.channels}"
        )
    return final, next(iter(steps)).denominator


def _reach(
    nodes: Sequence[Node], walk: Walk, *, ends: tuple[str, str], samples: tuple[int, int]
) -> int:
    """Trace the runs that the kept pixels 0 .. n - 1 read from the output back to the input.

    Args:
        nodes: In the order of computation.
        walk: What was found on the way there.
        ends: Names of input and output.
        samples: n, and how many samples of the output a pixel has.
    """
    (source, target), (pixels, scale) = ends, samples
    woven = _interleavings(nodes, walk, target)
    reach = 0
    for axis in range(2):
        runs = {target: (0, pixels * scale - 1)}
        for node in reversed(nodes):
            for output in node.outputs:
                if output not in runs:
                    continue
                run = runs[output]
                if output in walk.windows:
                    run = walk.windows[output][axis].reads(*run)
                for index, name in enumerate(tensor_names(walk.extents, node.inputs)):
                    input_run = run
                    if output in woven:
                        fine, block = woven[output]
                        input_run = place_run(runs[fine], block, divmod(index, block)[axis])
                    old = runs.get(name, input_run)
                    runs[name] = min(old[0], input_run[0]), max(old[1], input_run[1])
        first, last = runs.get(source, (0, pixels - 1))
        reach = max(reach, -first, last - pixels + 1)
    return reach


def _interleavings(nodes: Sequence[Node], walk: Walk, target: str) -> dict[str, tuple[str, int]]:
    """Find pictures of a tensor each, put together as the pixels of blocks.

    A pixel of the fine picture reads one of them, not all: DepthToSpace reads places of a block
    from channels that lie apart, here from what a Concat before it took from one tensor.

    Returns:
        Output of the Concat -> output of the DepthToSpace, side of a block.
    """
    woven = {}
    for node in nodes:
        if node.op != "DepthToSpace" or node.text("mode", "DCR") != "DCR":
            continue
        source, block = node.inputs[0], node.integer("blocksize", 0)
        readers = [other for other in nodes if source in other.inputs]
        parts = next((n.inputs for n in nodes if n.op == "Concat" and source in n.outputs), ())
        alike = len({walk.extents[name].channels for name in parts}) == 1
        if len(readers) == 1 and source != target and alike and len(parts) == block * block:
            woven[source] = node.outputs[0], block
    return woven


def _check_inputs(walk: Walk, node: Node) -> None:
    """Refuse tensors where constants belong, and numbers of other types than float."""
    if node.op not in _FREE:
        for index, name in enumerate(node.inputs[1:], start=1):
            if name:
                walk.constant_shape(node, index)
    if node.op == "Cast" and node.integer("to", 0) not in _FLOATS:
        raise BundleError(f"{node.label}: casts to float32 and float16 alone are admitted")
    places = [index for index, name in enumerate(node.inputs) if name in walk.booleans]
    if places != ([0] if node.op == "Where" else []):
        raise BundleError(
            f"{node.label}: what a comparison gives is the first input of a Where, nothing else"
        )
    if node.op in COMPARISONS:
        walk.booleans.update(node.outputs)


def _node_extents(walk: Walk, node: Node) -> list[Extent]:
    _check_inputs(walk, node)
    if node.op in ("Conv", "ConvTranspose"):
        return [_convolve(walk, node)]
    if node.op in ELEMENTWISE:
        return [_elementwise(walk, node)]
    if node.op in ("MaxPool", "AveragePool"):
        return [_pool(walk, node)]
    if node.op in ("DepthToSpace", "SpaceToDepth"):
        return [_shuffle(walk, node)]
    if node.op == "Resize":
        if is_corner_aligned(node):
            walk.mark_global(node)
        windows = resize_windows(node, walk.constants)
        return [walk.pass_through(node, walk.extent(node).channels, windows)]
    if node.op == "Pad":
        return [_pad(walk, node)]
    if node.op in ("Concat", "Split", "Slice"):
        return _regroup(walk, node)
    return [_global(walk, node)]


def _convolve(walk: Walk, node: Node) -> Extent:
    shape = walk.constant_shape(node, 1)
    groups = node.integer("group", 1)
    extent = walk.extent(node)
    if len(shape) != 4 or groups < 1:
        raise BundleError(f"{node.label}: expected a 4-D weight; got shape {shape}")
    if node.op == "Conv":
        fan_in, channels = shape[1] * groups, shape[0]
    else:
        fan_in, channels = shape[0], shape[1] * groups
    if fan_in != extent.channels or channels % groups:
        raise BundleError(f"{node.label}: weight {shape} does not fit {extent.channels} channels")
    if node.integers("kernel_shape", list(shape[2:])) != list(shape[2:]):
        raise BundleError(f"{node.label}: kernel_shape contradicts the weight {shape}")
    if len(node.inputs) > 2 and node.inputs[2] and walk.constant_shape(node, 2) != (channels,):
        raise BundleError(
            f"{node.label}: a bias has one number for each of {channels} channels; got shape "
            f"{walk.constant_shape(node, 2)}"
        )
    result = walk.pass_through(node, channels, convolution_windows(node, shape[2:]))
    # A transposed convolution spends its multiplications per sample of its input.
    grid = result.samples_per_pixel / channels
    if node.op == "ConvTranspose":
        grid = extent.samples_per_pixel / extent.channels
        # It multiplies all of its input before it adds up what falls on one sample.
        walk.workspace[node.outputs[0]] = grid * channels * math.prod(shape[2:])
    walk.mac_per_pixel += grid * math.prod(shape)
    if groups > 1 or not _is_blocked(node, extent.channels, channels, groups):
        walk.slow_per_pixel += grid * math.prod(shape)
    if not _is_blocked(node, extent.channels, channels, groups):
        walk.unblocked.append(node.label)
        if node.op == "Conv":  # blocks behind another one are put in plain order first
            walk.workspace[node.outputs[0]] = extent.samples_per_pixel
    else:
        walk.blocked.add(node.outputs[0])
    return result


def _pool(walk: Walk, node: Node) -> Extent:
    if len(node.outputs) > 1:
        raise BundleError(f"{node.label}: pooling with indices is refused")
    kernel = node.integers("kernel_shape", [])
    windows = convolution_windows(node, tuple(kernel))
    result = walk.pass_through(node, walk.extent(node).channels, windows)
    walk.slow_per_pixel += math.prod(kernel) * result.samples_per_pixel
    return result


def _is_blocked(node: Node, channels_in: int, channels_out: int, groups: int) -> bool:
    if node.op != "Conv":
        return False
    if groups == 1:
        return channels_in < _SMALL_INPUT or channels_in % _BLOCK_ALIGNMENT == 0
    if groups == channels_in == channels_out:
        return channels_out % _BLOCK_ALIGNMENT == 0
    per_group = (channels_in // groups, channels_out // groups)
    return all(channels % _LARGE_BLOCK == 0 for channels in per_group)


def _elementwise(walk: Walk, node: Node) -> Extent:
    operands = [name for name in node.inputs if name and name not in walk.constants]
    extents = [walk.extent(node, node.inputs.index(name)) for name in operands]
    if not extents:
        raise BundleError(f"{node.label}: computes with constants alone; fold them at export")
    if node.op == "BatchNormalization" and node.integer("training_mode", 0):
        raise BundleError(
            f"{node.label}: BatchNormalization in training mode looks at the whole picture; export "
            "the network in its evaluation mode"
        )
    if node.op not in ("BatchNormalization", "Clip"):
        check_broadcast(node, walk.constants)
    channels = {extent.channels for extent in extents}
    if node.op != "BatchNormalization":
        channels |= {
            walk.constants[name].shape[-3]
            for name in node.inputs
            if name in walk.constants and walk.constants[name].ndim >= 3
        }
    if len(channels - {1}) > 1:
        raise BundleError(f"{node.label}: {sorted(channels)} channels do not go together")
    return _common_extent(node, extents, max(channels))


def _common_extent(node: Node, extents: Sequence[Extent], channels: int) -> Extent:
    """Return the extent of a tensor computed sample by sample from several."""
    axes = {extent.axes for extent in extents if extent.axes is not None}
    if len(axes) > 1:
        grids = sorted(f"every {rows.step} px (+{rows.extra})" for rows, _ in axes)
        raise BundleError(
            f"{node.label}: tensors of different grids meet ({', '.join(grids)}); "
            "their sizes cannot agree"
        )
    return Extent(channels=channels, axes=next(iter(axes), None))


def _pad(walk: Walk, node: Node) -> Extent:
    if len(node.inputs) > 3 and node.inputs[3]:
        raise BundleError(f"{node.label}: Pad with axes is refused; state the pads of all axes")
    windows = pad_windows(node, walk.integers(node, 1))
    return walk.pass_through(node, walk.extent(node).channels, windows)


def _shuffle(walk: Walk, node: Node) -> Extent:
    extent, block = walk.extent(node), node.integer("blocksize", 0)
    if not 1 <= block <= 64:
        raise BundleError(f"{node.label}: blocksize {block} is refused")
    if node.op == "SpaceToDepth":
        window = unshuffle_window(block)
        return walk.pass_through(node, extent.channels * block * block, (window, window))
    if extent.channels % (block * block):
        raise BundleError(f"{node.label}: {extent.channels} channels are no {block}x{block} blocks")
    window = shuffle_window(block)
    return walk.pass_through(node, extent.channels // (block * block), (window, window))


def _regroup(walk: Walk, node: Node) -> list[Extent]:
    """Follow Concat, Split and Slice along the channels; along space they are refused."""
    if node.op == "Slice":
        return [_slice(walk, node)]
    if node.integer("axis", 0) not in (1, -3):
        raise BundleError(f"{node.label}: {node.op} is admitted along the channels only")
    if node.op == "Concat":
        extents = [walk.extent(node, index) for index in range(len(node.inputs))]
        return [_common_extent(node, extents, sum(extent.channels for extent in extents))]
    extent, count = walk.extent(node), len(node.outputs)
    if len(node.inputs) > 1 and node.inputs[1]:
        sizes = walk.integers(node, 1)
    else:
        size = -(-extent.channels // count)
        sizes = [size] * (count - 1) + [extent.channels - size * (count - 1)]
    if len(sizes) != count or min(sizes) < 1 or sum(sizes) != extent.channels:
        raise BundleError(f"{node.label}: parts {sizes} do not make {extent.channels} channels")
    return [extent.output_of(size) for size in sizes]


def _slice(walk: Walk, node: Node) -> Extent:
    extent = walk.extent(node)
    starts, ends = walk.integers(node, 1), walk.integers(node, 2)
    has = [index < len(node.inputs) and bool(node.inputs[index]) for index in range(5)]
    axes = walk.integers(node, 3) if has[3] else list(range(len(starts)))
    steps = walk.integers(node, 4) if has[4] else [1]
    if len(starts) != 1 or len(ends) != 1 or axes not in ([1], [-3]) or len(steps) != 1:
        raise BundleError(f"{node.label}: Slice is admitted along the channels only")
    if steps[0] == 0:
        raise BundleError(f"{node.label}: a Slice cannot have step 0")
    channels = len(range(extent.channels)[starts[0] : ends[0] : steps[0]])
    if channels == 0:
        raise BundleError(f"{node.label}: the Slice is empty")
    return extent.output_of(channels)


def _global(walk: Walk, node: Node) -> Extent:
    """Follow the operators that may see the whole picture."""
    extent = walk.extent(node)
    if node.op in NORMALIZATIONS:
        walk.mark_global(node)
        return extent
    if node.op in GLOBAL_POOLS:
        walk.mark_global(node)
        return Extent(channels=extent.channels, axes=None)
    axes = reduced_axes(node, walk.constants)
    if reduces_space(axes):
        walk.mark_global(node)
    if node.op == "Softmax":
        return extent
    if node.op in REDUCTIONS and node.integer("keepdims", 1) == 1:
        channels = 1 if _CHANNEL_AXIS in axes else extent.channels
        return (
            Extent(channels=channels, axes=None)
            if reduces_space(axes)
            else extent.output_of(channels)
        )
    raise BundleError(f"{node.label}: {node.op} that drops axes is refused; keep dimensions")
