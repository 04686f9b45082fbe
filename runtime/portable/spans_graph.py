"""The graphs of what a host knows before it begins: its blocks along an axis, and its noise.

`spans` lays out `camkit.runtime.bank.blocks`, those on the far side of the axis mirrored; `noise`
is that of `camkit.bundle.sensor`.
"""

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.bank.blocks import BORDER_SHARE, lay_spans
from camkit.runtime.portable.demosaic_taps import MARGIN_PX
from camkit.runtime.portable.facts import CameraFacts
from camkit.runtime.portable.graph_builder import GraphBuilder, Value


def spans_graph(facts: CameraFacts) -> GraphBuilder:
    """Return the graph of the blocks along an axis of a capture."""
    graph = GraphBuilder("spans")
    side, overlap = facts.bank.block_px, facts.bank.overlap_px
    step, border = side - overlap, int(overlap * BORDER_SHARE)
    size = graph.input("size_px", (1,), "int64")
    axis = graph.input("axis_px", (1,), "float64")
    red = graph.input("red", (1,), "int64")
    count = ((size + (2 * border - overlap + step - 1)) / step).at_least(1)
    start = (count * step + overlap - size) / 2
    number = graph.node("Range", _whole(graph, 0), count.shaped(), _whole(graph, 1))
    first = number * step - start
    rise = _rise(side, overlap)
    idle = int(np.flatnonzero(rise)[0])  # samples of a shared border that count for nothing
    has_neighbours = number > 0, number < count - 1
    low = (first + has_neighbours[0].cast("int64") * idle).at_least(0)
    high = (first + (side - 1) - has_neighbours[1].cast("int64") * idle).at_most(size - 1)
    place = ((low + high).cast("float64") * 0.5 - axis) * facts.pitch_mm
    is_mirrored = place < (0.0 if facts.kernels.turns else -np.inf)
    mirrored = is_mirrored.cast("int64")
    turn = 1 - mirrored * 2
    samples = np.arange(-MARGIN_PX, side + MARGIN_PX)
    at = _column(first) + _column(mirrored) * (side - 1) + _column(turn) * samples
    period = (size * 2 - 2).at_least(1)
    remainder = graph.node("Mod", at, period)
    inner = at.part(1, MARGIN_PX, side + MARGIN_PX)
    window = graph.node("And", inner > -1, inner < size).cast("float32")
    for has, edge in zip(has_neighbours, (rise, rise[::-1]), strict=True):
        turned = graph.node("Where", _column(is_mirrored), edge[::-1], edge)
        window = window * graph.node("Where", _column(has), turned, np.ones(1, np.float32))
    place = graph.node("Where", is_mirrored, place * -1.0, place).cast("float32")
    graph.output("first_px", first, ("n",))
    graph.output("turn", turn, ("n",))
    graph.output("phase", graph.node("Mod", red - first - mirrored, 2), ("n",))
    graph.output("place_mm", place, ("n",))
    graph.output("index", remainder.at_most(period - remainder), ("n", side + 2 * MARGIN_PX))
    graph.output("window", window, ("n", side))
    return graph


def _rise(side: int, overlap: int) -> NDArray[np.float32]:
    """Return the window of a block with a neighbour before it, and none behind."""
    middle = lay_spans(3 * side, side, overlap)[1]
    rise = np.zeros(side, np.float32)
    rise[middle.inner] = middle.weights
    rise[side // 2 :] = 1
    return rise


def _column(line: Value) -> Value:
    return line.graph.node("Unsqueeze", line, np.array([1], np.int64))


def _whole(graph: GraphBuilder, number: int) -> Value:
    return graph.constant(number, "int64")


def noise_graph(facts: CameraFacts) -> GraphBuilder:
    """Return the graph of the noise at an ISO, see `LightSensor.one_noise_at`."""
    graph, sensor = GraphBuilder("noise"), facts.sensor
    iso = graph.input("iso", (1,), "float64")
    entries = sensor.noise
    logarithms = np.log([one.iso for one in entries])
    gains = np.log([one.gain_e_per_dn for one in entries])
    reads = np.array([one.read_noise_e for one in entries])
    at = graph.node("Log", iso)
    gain, read = at * 0.0 + gains[0], at * 0.0 + reads[0]
    for i, width in enumerate(np.diff(logarithms)):
        share = ((at - logarithms[i]) / width).clip(0.0, 1.0)
        gain, read = gain + share * np.diff(gains)[i], read + share * np.diff(reads)[i]
    gain = graph.node("Exp", gain - (at - logarithms[-1]).at_least(0.0))
    shot = 1 / (gain * (sensor.white_level - sensor.black_level))
    for name, value in (("shot", shot), ("read_variance", (read * shot) * (read * shot))):
        one = value.cast("float32")
        graph.output(name, graph.joined([one] * 3, axis=0), (3,))
    return graph
