"""The graphs of a place: what the filter of a block knows of its place before it sees a block.

    place_mm -> kernels of the field height -> turned -> transfer H -> terms of the filter

Kernels are those of `camkit.runtime.bank.psf`: linear in the field height, turned by a Catmull-Rom
gather, negatives cut, each with a sum of one. The terms are those of
`camkit.runtime.bank.joint_colours`, or near the axis of `camkit.runtime.bank.mosaic`.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.bank.joint_colours import CORNER_FREQUENCY
from camkit.runtime.bank.mosaic import GREENS, SIGNS
from camkit.runtime.portable.facts import CameraFacts
from camkit.runtime.portable.graph_builder import GraphBuilder, Value
from camkit.runtime.portable.spectra import PHASES, Spectrum, crossed, kernel_span, spectrum

PAD_PX: Final = 4
"""Zeros around a kernel that is turned: the taps of a clipped position lie in them."""
FAR_PX: Final = 1e4
LEAST_HEIGHT_MM: Final = 1e-9
"""Below it a place is on the axis, where nothing is turned."""


def place_graph(facts: CameraFacts, *, mosaic: bool) -> GraphBuilder:
    """Return the graph of a place, for blocks restored from demosaicked planes or the mosaic."""
    graph = GraphBuilder("place_mosaic" if mosaic else "place")
    place = graph.input("place_mm", (2,))
    height = (place * place).sum(0).sqrt()
    kernels = _turned(graph, facts, place, height)
    reach = facts.kernels.kernels.shape[-1] // 2
    transfer = spectrum(graph, kernels, facts.shape, reach)
    doubt = _doubt(graph, facts, height)
    add = _mosaic_terms if mosaic else _joint_terms
    add(graph, facts, transfer, doubt)
    return graph


def fall_table(facts: CameraFacts) -> NDArray[np.float64]:
    """Return F times the samples of a block, (4, 2, q, q)."""
    samples = float(facts.shape.side) ** 2
    power = -facts.together.exponent / 2
    return np.asarray(samples * (facts.shape.squares + CORNER_FREQUENCY**2) ** power)


def _turned(graph: GraphBuilder, facts: CameraFacts, place: Value, height: Value) -> Value:
    """Return the kernels of a place in four phases, (3, 4, m, m)."""
    kernels = facts.kernels
    fields, colours, side, _ = kernels.kernels.shape
    wide = side + 2 * PAD_PX
    margins = ((0, 0), (PAD_PX, PAD_PX), (PAD_PX, PAD_PX), (0, 0))
    table = np.pad(np.moveaxis(kernels.kernels, 1, -1), margins)
    lines = graph.table("kernels", table.reshape(fields, wide, wide, colours))
    kernel = _interpolated(lines, kernels.field_heights_mm, height)
    half = side // 2
    down, across = sample_positions(half)
    upright = height.clip(LEAST_HEIGHT_MM, 1e9)
    out_x, out_y = (place / upright).parts(0, 2)
    out_y = out_y + graph.node("Cast", graph.node("Less", height, LEAST_HEIGHT_MM), to=1)
    if not kernels.turns:
        out_x, out_y = out_x * 0.0, out_y * 0.0 + 1.0
    most = half + PAD_PX - 2.0
    rows = (out_x * across + out_y * down).clip(-most, most) + (half + PAD_PX)
    columns = (out_y * across - out_x * down).clip(-most, most) + (half + PAD_PX)
    row, column = rows.floor(), columns.floor()
    kernel = kernel.shaped(wide, wide, colours)
    taps = graph.joined([kernel.part(1, i, wide - 3 + i) for i in range(4)], axis=2)
    taps = taps.shaped(wide * (wide - 3), 4 * colours)
    first = ((row - 1.0) * float(wide - 3) + (column - 1.0)).cast("int64")
    row_weights, column_weights = _catmull_rom(rows - row), _catmull_rom(columns - column)
    total: Value | None = None
    for i, weight in enumerate(row_weights):
        part = taps.gather(first + np.int64(i * (wide - 3)), 0).turned(1, 0) * weight
        total = part if total is None else total + part
    assert total is not None
    mixed: Value | None = None
    for part, weight in zip(total.parts(0, 4), column_weights, strict=True):
        term = part * weight
        mixed = term if mixed is None else mixed + term
    assert mixed is not None
    lit = mixed.relu()
    _, count = kernel_span(half)
    return (lit / lit.sum(1)).shaped(colours, 4, count, count)


def sample_positions(reach: int) -> NDArray[np.float64]:
    """Return rows and columns, (2, 4 m m), of the samples of a kernel in four phases.

    Those beyond the kernel lie far away, where it is zero.
    """
    first, count = kernel_span(reach)
    line = first + 2.0 * np.arange(count)
    grids = np.stack(
        [np.stack(np.meshgrid(line + py, line + px, indexing="ij")) for py, px in PHASES], axis=1
    )
    outside = (np.abs(grids) > reach).any(axis=0)
    return np.asarray(np.where(outside, FAR_PX, grids).reshape(2, -1))


def _catmull_rom(t: Value) -> list[Value]:
    """Return the weights of the samples -1, 0, 1, 2, see `camkit.runtime.bank.psf`."""
    t2 = t * t
    t3 = t2 * t
    return [
        t2 - (t3 + t) * 0.5,
        t3 * 1.5 - t2 * 2.5 + 1.0,
        t2 * 2.0 - t3 * 1.5 + t * 0.5,
        (t3 - t2) * 0.5,
    ]


def _interpolated(table: Value, heights_mm: NDArray[np.float64], height: Value) -> Value:
    """Return the line of a table (height, ...) at a height, (1, ...); its last one holds beyond."""
    count = len(heights_mm)
    if count == 1:
        return table
    # exact at the heights of the table, whatever their distances
    starts, widths = heights_mm[:-1], np.diff(heights_mm)
    shares = ((height - starts) / widths).clip(0.0, 1.0)
    low = (shares.sum(0) - 1e-7).clip(0.0, count - 2.0).floor().cast("int64")
    share = shares.gather(low, 0)
    below, above = table.gather(low, 0), table.gather(low + np.int64(1), 0)
    return below + (above - below) * share


def _doubt(graph: GraphBuilder, facts: CameraFacts, height: Value) -> Value:
    """Return mistrust V F, (3, 4, 2, q, q)."""
    spread, q = facts.together.spread, facts.shape.q
    heights = np.array(spread.heights_mm)
    variance = np.array(spread.variance)
    line = _interpolated(graph.constant(variance), heights, height)
    places = np.array(spread.frequencies)
    at = np.minimum(np.sqrt(facts.shape.squares.ravel()), places[-1])
    hats = np.stack([np.interp(at, places, unit) for unit in np.eye(len(places))])
    hats = hats * fall_table(facts).ravel() * facts.together.mistrust
    variance_now = line.shaped(variance.shape[1], len(places)) @ graph.table("spread", hats)
    return variance_now.shaped(variance.shape[1], 4, 2, q, q)


def _joint_terms(graph: GraphBuilder, facts: CameraFacts, transfer: Spectrum, doubt: Value) -> None:
    q = facts.shape.q
    shape = (3, 4, 2, q, q)
    re, im = transfer
    fall = graph.table("fall", fall_table(facts))
    power = (re * re + im * im) * fall
    graph.output("transfer_re", re, shape)
    graph.output("transfer_im", im, shape)
    graph.output("power", power, shape)
    graph.output("doubt", doubt + power * facts.together.own, shape)


def _mosaic_terms(
    graph: GraphBuilder, facts: CameraFacts, transfer: Spectrum, doubt: Value
) -> None:
    q = facts.shape.q
    re, im = transfer
    graph.output("transfer_re", re, (3, 4, 2, q, q))
    graph.output("transfer_im", im, (3, 4, 2, q, q))
    signs = np.array(SIGNS)[:, :, None, None, None] / 4
    h = re * signs, im * signs
    fall = graph.table("fall", fall_table(facts))
    fh = h[0] * fall, h[1] * fall
    greens = np.array([1.0, 2.0, 1.0])[:, None, None, None, None] / 16
    alone = doubt * greens + (h[0] * fh[0] + h[1] * fh[1]) * (1 + facts.together.own)
    red, _, blue = zip(h[0].parts(0, 3), h[1].parts(0, 3), strict=True)
    _, fh_green, fh_blue = zip(fh[0].parts(0, 3), fh[1].parts(0, 3), strict=True)
    by_green = [crossed(colour, fh_green) for colour in (red, blue)]
    cross = tuple(
        graph.joined([_by_green(graph, pair[part]) for pair in by_green], axis=0) for part in (0, 1)
    )
    red_blue = [part.sum(1) for part in crossed(red, fh_blue)]
    alone_red, alone_green, alone_blue = alone.parts(0, 3)
    green_sums = _by_green(graph, alone_green)
    power = [alone_red.sum(1), green_sums, alone_blue.sum(1)]
    (cross_red_re, cross_blue_re), (cross_red_im, cross_blue_im) = (
        part.parts(0, 2) for part in cross
    )
    detour = crossed((cross_red_re, cross_red_im), (cross_blue_re, cross_blue_im))
    low = [graph.joined([one.part(1, 0, 1) for one in part], axis=1) for part in _lows(h)]
    graph.output("sharp_re", fh[0], (3, 4, 2, q, q))
    graph.output("sharp_im", fh[1] * -1.0, (3, 4, 2, q, q))
    graph.output("low_re", low[0], (1, 4, 2, q, q))
    graph.output("low_im", low[1], (1, 4, 2, q, q))
    graph.output("power", graph.joined(power, axis=1), (1, 4, 2, q, q))
    graph.output("cross_re", cross[0], (2, 2, 2, q, q))
    graph.output("cross_im", cross[1], (2, 2, 2, q, q))
    graph.output("red_blue_re", red_blue[0], (1, 1, 2, q, q))
    graph.output("red_blue_im", red_blue[1], (1, 1, 2, q, q))
    graph.output("detour_re", detour[0], (1, 2, 2, q, q))
    graph.output("detour_im", detour[1], (1, 2, 2, q, q))


def _lows(h: Spectrum) -> list[list[Value]]:
    """Return H of the low alias as R, +, -, B see it: the difference of the greens does not."""
    lows = []
    for part in h:
        red, green, blue = part.parts(0, 3)
        lows.append([red, green, green * 0.0, blue])
    return lows


def _by_green(graph: GraphBuilder, aliases: Value) -> Value:
    """Return (1, 2, ...) sums over the aliases that sum and difference of the greens see."""
    parts = aliases.parts(1, 4)
    sums = []
    for green in (1, 2):
        first, second = (
            part for part, number in zip(parts, GREENS, strict=True) if number == green
        )
        sums.append(first + second)
    return graph.joined(sums, axis=1)
