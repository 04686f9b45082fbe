"""The graphs of the warp: places of output pixels in the capture, and pixels from there.

`places` computes in float64 what `camkit.runtime.geometry.warp` does for bundles whose places are
in fixed point: nodes every 8 px in 1/256 px, linear between them, rounded to 1/32 px. The sums are
exact, so every reader finds the same places. `warp` takes the samples of a box of the capture to
such places: cubic, limited at rims of lamps, and in linear Rec.709.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.color import rec709_of_planes
from camkit.runtime.geometry.distortion import reference_channel
from camkit.runtime.geometry.resampling import FLOOR, WHITE
from camkit.runtime.geometry.warp import LATTICE_PX, NODE_STEPS, PLACE_STEPS
from camkit.runtime.portable.facts import CameraFacts
from camkit.runtime.portable.graph_builder import GraphBuilder, Value

TILE_PX: Final = 512
NEWTON_STEPS: Final = 12
BORDER_PX: Final = 3
"""Of repeated samples around a box: as far as the samples of a place beyond its border lie."""


def map_count(facts: CameraFacts) -> int:
    """Return 1 where all colours share their distortion, else their number."""
    coefficients = facts.bundle.distortion.coefficients
    even = facts.bundle.distortion.even_coefficients
    same = (coefficients == coefficients[0]).all() and (even is None or (even == even[0]).all())
    return 1 if same else len(coefficients)


def places_graph(facts: CameraFacts) -> GraphBuilder:
    """Return the graph of the places of a tile, from its first pixel on."""
    graph = GraphBuilder("places")
    target = graph.input("target_px", (2,), "float64")
    axis = graph.input("axis_px", (2,), "float64")
    middle = graph.input("middle_px", (2,), "float64")
    distortion = facts.bundle.distortion
    unit = facts.pitch_mm / distortion.radius_mm
    centre = (middle - axis) * unit
    shift = _shift(centre, distortion.row(reference_channel(distortion)))
    cells = TILE_PX // LATTICE_PX
    steps = np.arange(-1, cells + 1) * float(LATTICE_PX) + (LATTICE_PX - 1) / 2
    along = (target - axis).shaped(2, 1) + steps[None]
    x, y = along.parts(0, 2)
    shift_x, shift_y = shift.shaped(2, 1).parts(0, 2)
    x, y = x * unit + shift_x, (y * unit + shift_y).shaped(-1, 1)
    square = x * x + y * y
    maps = []
    for channel in range(map_count(facts)):
        growth = _growth(distortion.row(channel), square)
        first = target - axis
        first_x, first_y = first.parts(0, 2)
        column = growth * x * (1 / unit) - first_x
        row = growth * y * (1 / unit) - first_y
        maps.append(
            graph.joined([part.shaped(1, 1, cells + 2, cells + 2) for part in (column, row)], 1)
        )
    nodes = graph.joined(maps, axis=0)
    nodes = (nodes * float(NODE_STEPS) + 0.5).floor()
    down = _dense(nodes, cells)
    dense = _dense(down.turned(0, 1, 3, 2), cells).turned(0, 1, 3, 2)
    places = (dense * (PLACE_STEPS / NODE_STEPS) + 0.5).floor() * (1 / PLACE_STEPS)
    out = places.turned(0, 2, 3, 1).cast("float32")
    graph.output("places", out, (map_count(facts), TILE_PX, TILE_PX, 2))
    for name, operator in (("least", "ReduceMin"), ("most", "ReduceMax")):
        edge = graph.node(operator, nodes, np.array([0, 2, 3], np.int64), keepdims=0)
        graph.output(name, (edge * (1 / NODE_STEPS)).cast("float32"), (2,))
    return graph


def _dense(nodes: Value, cells: int) -> Value:
    """Return (maps, 2, 8 cells, w) of (maps, 2, cells + 2, w), linear between nodes."""
    k = np.arange(LATTICE_PX)
    weight_before = np.maximum((LATTICE_PX - 1) / 2 - k, 0) / LATTICE_PX
    weight_behind = weight_before[::-1]
    weights = np.zeros((cells, LATTICE_PX, cells + 2))
    for cell in range(cells):
        weights[cell, :, cell] = weight_before
        weights[cell, :, cell + 1] = 1 - weight_before - weight_behind
        weights[cell, :, cell + 2] = weight_behind
    return nodes.graph.constant(weights.reshape(-1, cells + 2), nodes.kind) @ nodes


def _growth(c: NDArray[np.float64], square: Value) -> Value:
    growth: Value = ((square * c[3] + c[2]) * square + c[1]) * square + c[0]
    if len(c) > 4:
        even = ((square * c[6] + c[5]) * square + c[4]) * square.sqrt()
        growth = growth + even
    return growth


def _shift(centre: Value, c: NDArray[np.float64]) -> Value:
    """Return (2,): how far the middle moves, in units of the distortion; Newton's method."""
    distorted = (centre * centre).sum(0).sqrt()
    radius = distorted * (1 / c[0])
    for _ in range(NEWTON_STEPS):
        square = radius * radius
        growth = _growth(c, square)
        slope = ((square * (7 * c[3]) + 5 * c[2]) * square + 3 * c[1]) * square + c[0]
        if len(c) > 4:
            more = ((square * (6 * c[6]) + 4 * c[5]) * square + 2 * c[4]) * radius
            slope = slope + more
        radius = radius - (radius * growth - distorted) / slope
    ratio: Value = (radius + 1e-30) / (distorted + 1e-30 * float(c[0]))
    return centre * (ratio - 1.0)


def warp_graph(facts: CameraFacts, *, limited: bool) -> GraphBuilder:
    """Return the graph that takes samples of a box to places.

    Args:
        facts: Of the camera.
        limited: Whether values are limited at rims of lamps, and below `FLOOR`. The other graph is
            faster and serves where there are none; it states its least value.
    """
    graph = GraphBuilder("warp_limited" if limited else "warp")
    maps = map_count(facts)
    planes = graph.input("planes", (1, 3, "h", "w"))
    places = graph.input("places", (maps, TILE_PX, TILE_PX, 2))
    first = graph.input("first_px", (2,))
    if maps > 1:
        planes = planes.turned(1, 0, 2, 3)
    at = places.shaped(maps, TILE_PX, 2 * TILE_PX) - _long_row(graph, first)
    values = _sampled(graph, planes, at, "bicubic")
    if limited:
        values = _limited(graph, planes, at, values)
    else:
        least = graph.node("ReduceMin", values, keepdims=0)
        graph.output("least", least.shaped(1), (1,))
    matrix = rec709_of_planes(np.array(facts.sensor.color_matrix))
    color = matrix @ values.shaped(3, TILE_PX * TILE_PX)
    graph.output("out", color.shaped(3, TILE_PX, TILE_PX), (3, TILE_PX, TILE_PX))
    return graph


def _limited(graph: GraphBuilder, planes: Value, at: Value, values: Value) -> Value:
    """Return values within the range of their samples, see `resampled_limited`."""
    pads = np.array([0, 0, BORDER_PX, BORDER_PX] * 2, np.int64)
    wide = graph.node("Pad", planes, pads, mode="edge")
    whole = at.floor() + (BORDER_PX - 1.0)

    def most(samples: Value) -> Value:
        pooled = graph.node("MaxPool", samples, kernel_shape=[4, 4])
        return _sampled(graph, pooled, whole, "nearest")

    high, low = most(wide), most(wide * -1.0) * -1.0
    is_lit, is_dark = graph.node("Greater", high, WHITE), graph.node("LessOrEqual", low, WHITE)
    rim = graph.node("And", is_lit, is_dark)
    limited = graph.node("Or", rim, graph.node("Less", values, FLOOR))
    return graph.node("Where", limited, values.at_least(low).at_most(high), values)


def _long_row(graph: GraphBuilder, pair: Value) -> Value:
    """Return x, y, x, y, ... of (2,): beside places it is added in long rows."""
    whole = graph.node("Expand", pair.shaped(1, 2), np.array([TILE_PX, 2], np.int64))
    return whole.shaped(2 * TILE_PX)


def _sampled(graph: GraphBuilder, planes: Value, at: Value, mode: str) -> Value:
    """Return planes at pixel places; beyond the border its samples repeat."""
    sides = graph.node("Shape", planes).gather(np.array([3, 2]), 0)
    step = _long_row(graph, 2.0 / graph.node("Cast", sides, to=1))
    grid = (at + 0.5) * step - 1.0
    grid = grid.shaped(0, TILE_PX, TILE_PX, 2)
    return graph.node("GridSample", planes, grid, mode=mode, padding_mode="border", align_corners=0)
