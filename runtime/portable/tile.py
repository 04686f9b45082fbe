"""The graph of a tile: planes of the bank in, even light of the camera's colours out.

    planes -> equal noise -> network -> its light bounded -> light -> burnt-out light made neutral
           -> relative illumination divided out

A tile comes with its halo, of which the host keeps nothing.
"""

from typing import Final

import numpy as np
import onnx

from camkit.bundle.light_bound import (
    BRIGHT,
    BRIGHT_FROM,
    BRIGHT_NOISE,
    CELL_PX,
    CELLS_AVERAGED,
    NEAR_PX,
    NOISE_OF_CELLS,
    SMOOTHING,
    LightBound,
)
from camkit.bundle.stages import Network
from camkit.psf import FrozenPsf
from camkit.runtime.color import CLIP_FULL, CLIP_START
from camkit.runtime.plan.bounded_networks import bounded_stages
from camkit.runtime.portable.facts import CameraFacts
from camkit.runtime.portable.graph_builder import GraphBuilder, Value
from camkit.runtime.signal.stabilise import FAMILIAR_READ, LEAST_FAMILIAR_E

TABLE_SAMPLES: Final = 1 << 17
"""Of the squared height: the nearest one errs by some millionths."""
_TINY: Final = 1e-6


def tile_graph(facts: CameraFacts, size: str) -> GraphBuilder:
    """Return the graph of a tile for a network of some size."""
    graph = GraphBuilder(f"tile_{size}")
    planes = graph.input("planes", (1, 6, "h", "w"))
    share = graph.input("kept", (1, 1, "h", "w"))
    gains = graph.input("gains", (3,))
    shot, read = graph.input("shot", (3,)), graph.input("read_variance", (3,))
    origin = graph.input("origin_mm", (2,))
    shot, read = _familiar(facts, shot * gains, read * gains * gains)
    scale = facts.network.scale
    slope = 1 / (shot * (scale * scale))
    offset = slope * (read / shot)
    twice = (graph.joined([part, part], axis=0) for part in (slope, offset))
    stable = _line(graph, planes, *twice).relu().sqrt()
    role = facts.network.role
    model = onnx.load_from_string(facts.bundle.network_bytes(role, size))
    output = graph.copied(model, stable).relu()
    front = stable.part(1, 3, 6)
    added = output - front
    network = _bounded_network(facts)
    bound, planes_of_bundle = network.light, facts.bundle.manifest.all_planes
    if not any(planes_of_bundle[name].domain == "mask" for name in network.takes):
        share = share * 0.0 + 1.0
    if bound is not None:
        added = added - _excess(graph, (front, added, output), share, (bound, scale))
    output = front + added * share
    if bound is not None and bound.keeps_bright:
        bright = (slope * BRIGHT + offset).relu().sqrt()
        bright_share = _bright_share(front * (1 / bright).shaped(1, 3, 1, 1))
        output = output.at_least(front * bright_share - BRIGHT_NOISE * 0.5 / scale)
    output = output.relu()
    steepness = 1 / slope
    light = _line(graph, output * output, steepness, offset * steepness * -1.0)
    light = _neutral(graph, light, gains)
    graph.output("out", light * _gain(graph, facts, light, origin), (1, 3, "h", "w"))
    return graph


def _line(graph: GraphBuilder, planes: Value, slope: Value, offset: Value) -> Value:
    """Return slope times planes, and the offset, one of each per channel, in one pass."""
    zero, one = slope * 0.0, slope * 0.0 + 1.0
    return graph.node("BatchNormalization", planes, slope, offset, zero, one, epsilon=0.0)


def kept_graph() -> GraphBuilder:
    """Return the graph of how much of what a network adds is kept beside clipped samples."""
    graph = GraphBuilder("kept")
    clipped = graph.input("clipped", (1, 1, "h", "w"))
    share: Value | float = 1.0
    for reach in NEAR_PX:
        near = clipped
        for axis in (0, 1):
            sides = [1, 1]
            sides[axis] = 2 * reach + 1
            pads = [side // 2 for side in sides] * 2
            near = graph.node("MaxPool", near, kernel_shape=sides, pads=pads)
        share = share - near * (1 / len(NEAR_PX))
    assert isinstance(share, Value)
    graph.output("out", share, (1, 1, "h", "w"))
    return graph


def _familiar(facts: CameraFacts, shot: Value, read: Value) -> tuple[Value, Value]:
    """Return the noise that the network knows, see `familiar_noise`."""
    reads = [entry.read_noise_e for entry in facts.sensor.noise]
    low_e, high_e = min(reads), max(FAMILIAR_READ * max(reads), LEAST_FAMILIAR_E)
    least = shot * low_e
    return shot.at_least(read.sqrt() * (1 / high_e)), read.at_least(least * least)


def _bounded_network(facts: CameraFacts) -> Network:
    stages = bounded_stages(facts.bundle.manifest, "stated")
    return next(stage for stage in stages if isinstance(stage, Network))


def _excess(
    graph: GraphBuilder,
    change: tuple[Value, Value, Value],
    share: Value,
    rule: tuple[LightBound, float],
) -> Value:
    """Return the change that goes beyond the bound, see `camkit.runtime.network.light_bound`."""
    (front, added, output), (bound, scale) = change, rule
    total, cell = (output + front) * share, (0.5 / scale / CELL_PX) ** 2

    def means(planes: Value) -> Value:
        side = [CELL_PX, CELL_PX]
        return graph.node("AveragePool", planes, kernel_shape=side, strides=side)

    change_of_cells = _smoothed(graph, means(added * total))
    change_of_cells = change_of_cells / _smoothed(graph, means(total)).at_least(_TINY)
    level = means(front)
    mean = _smoothed(graph, level)
    spread = (_smoothed(graph, level * level) - mean * mean).relu()
    square = (spread - NOISE_OF_CELLS * cell).relu() * bound.spread**2
    square = square + bound.noise**2 * cell / CELLS_AVERAGED
    if bound.light:
        square = square + mean * mean * (bound.light / 2) ** 2
    limit = square.sqrt()
    excess = change_of_cells - change_of_cells.at_most(limit).at_least(limit * -1.0)
    scales = np.array([1, 1, CELL_PX, CELL_PX], np.float32)
    return graph.node("Resize", excess, None, scales, mode="linear")


def _smoothed(graph: GraphBuilder, cells: Value) -> Value:
    pads = np.array([0, 0, 1, 1, 0, 0, 1, 1], np.int64)
    padded = graph.node("Pad", cells, pads, mode="edge")
    kernel = np.tile(np.outer(SMOOTHING, SMOOTHING), (3, 1, 1, 1))
    return graph.node("Conv", padded, kernel, group=3)


def _bright_share(levels: Value) -> Value:
    red, green, blue = levels.parts(1, 3)
    least = red.at_most(green).at_most(blue)
    return ((least - BRIGHT_FROM) * (1 / (1 - BRIGHT_FROM))).clip(0.0, 1.0)


def _neutral(graph: GraphBuilder, light: Value, levels: Value) -> Value:
    """Return burnt-out light made neutral, see `camkit.runtime.color.recover_highlights`.

    Args:
        graph: To add to.
        light: (1, 3, h, w).
        levels: (3,) at which the channels clip.
    """
    steepness = 1 / (levels * (CLIP_FULL - CLIP_START))
    start = levels * steepness * -CLIP_START
    clipped = _line(graph, light, steepness, start).clip(0.0, 1.0)
    red, green, blue = light.parts(1, 3)
    most = red.at_least(green).at_least(blue)
    assumed = light + clipped * (most - light)
    red, green, blue = assumed.parts(1, 3)
    others = (red + green + blue - assumed) * 0.5
    return light + (clipped * (others - light)).relu()


def _gain(graph: GraphBuilder, facts: CameraFacts, light: Value, origin: Value) -> Value:
    """Return (h, w): one over the relative illumination, the nearest sample by squared height."""
    optics = facts.bundle.illumination
    radial = optics.radial_illumination if isinstance(optics, FrozenPsf) else optics
    assert radial is not None
    end = max(float(radial.heights_mm[-1] * 1.05) ** 2, 1e-6)
    squares = np.linspace(0.0, end, TABLE_SAMPLES)
    gains = 1 / np.interp(squares, radial.heights_mm**2, radial.light)
    sides = graph.node("Shape", light)
    lines = []
    for axis, place in ((3, origin.part(0, 0, 1)), (2, origin.part(0, 1, 2))):
        count = Value(graph, sides.gather(np.int64(axis), 0).name, "int64")
        at = graph.node("Range", Value(graph, graph.constant(0, "int64").name, "int64"), count, 1)
        line = at.cast("float32") * facts.pitch_mm + place
        lines.append(line * line)
    square = lines[0] + graph.node("Unsqueeze", lines[1], np.array([1], np.int64))
    index = (square * ((TABLE_SAMPLES - 1) / end) + 0.5).at_most(TABLE_SAMPLES - 1.0)
    return graph.table("illumination_gain", gains).gather(index.cast("int64"), 0)
