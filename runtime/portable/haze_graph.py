"""The graphs of a haze: what clears the pixels of a capture of it, found in coarse cells.

    cells: mosaic -> means of cells, and which of them clipped
    haze:  cells -> scene in cells, solved for in rounds -> gain and veil of every cell
    block: light of a pixel -> gain x light + veil

See `camkit.runtime.bank.cell_means` and `camkit.runtime.bank.haze`. The few kernels that stand for
those of all places are tables: nothing of the optics is left to find.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.stages import Dehaze
from camkit.runtime.bank.haze import (
    CORE_TERMS,
    DAMPING,
    LEAST_RESPONSE,
    MARGIN_CELLS,
    HazyKernels,
    few_of,
)
from camkit.runtime.bank.place_blur import AZIMUTHS, FewKernels
from camkit.runtime.portable.cell_waves import CellSpectrum, CellWaves, line
from camkit.runtime.portable.demosaic_taps import COLOURS, MARGIN_PX
from camkit.runtime.portable.graph_builder import GraphBuilder, Value
from camkit.runtime.portable.spectra import PHASES, BlockShape

CLEAR: Final = "clear"
"""Input of a block: gain and veil of every cell, (6, rows, columns)."""
_AXES: Final = {count: np.arange(count) for count in (1, 2)}


@dataclass(frozen=True, slots=True, kw_only=True)
class HazeFacts:
    """The haze of a camera.

    Attributes:
        stage: Of the bundle.
        kernels: Core and haze of the colours.
        pitch_mm: The distance of pixels.
    """

    stage: Dehaze
    kernels: HazyKernels
    pitch_mm: float


def cells_graph(facts: HazeFacts) -> GraphBuilder:
    """Return the graph of the means of a mosaic over cells."""
    graph, side = GraphBuilder("cells"), facts.kernels.cell_px
    mosaic = graph.input("mosaic", ("h", "w"))
    levels, gains = graph.input("levels", (3,)), graph.input("gains", (3,))
    red_x, red_y = graph.input("red_px", (2,), "int64").parts(0, 2)
    black, white, clip = levels.parts(0, 3)
    colours = graph.constant(_colours_of_sites()).gather(red_y * 2 + red_x, 0).shaped(3, 4, 1, 1)
    offsets = np.array(PHASES)
    down, across = (
        _CellSide(graph, size, side, offset)
        for size, offset in zip(sides_of(graph, mosaic), offsets.T, strict=True)
    )
    sites = np.zeros((4, 1, side, side))
    for number, (y, x) in enumerate(PHASES):
        sites[number, 0, y::2, x::2] = 1

    def sums(samples: Value) -> Value:
        plane = graph.node("Unsqueeze", samples, _AXES[2])
        # what lies beyond the capture counts for nothing
        pads = [0, 0, side - 1, side - 1]
        whole = graph.node("Conv", plane, sites, strides=[side, side], pads=pads)
        return graph.node("Conv", down.merge @ whole @ across.merge.turned(1, 0), colours)

    count = down.counts.shaped(1, 4, -1, 1) * across.counts.shaped(1, 4, 1, -1)
    count = graph.node("Conv", count, colours)
    # sums of whole numbers: exact below 2^24
    light = (sums(mosaic) - count * black) / count.at_least(1.0)
    means = light * (gains / (white - black)).shaped(1, 3, 1, 1)
    is_clipped = graph.node("GreaterOrEqual", mosaic, clip).cast("float32")
    for name, planes in (("means", means), ("clipped", sums(is_clipped).at_most(1.0))):
        graph.output(name, graph.node("Squeeze", planes, _AXES[1]), (3, "rows", "columns"))
    return graph


class _CellSide:
    """The cells along a side of a capture; the last one takes a rest of less than half a cell.

    Attributes:
        merge: (cells, parts) float32: 1 for the parts of `side` px that a cell sums.
        counts: (4, cells) float32: samples along the side of every site of the mosaic.
    """

    def __init__(
        self, graph: GraphBuilder, size: Value, side: int, offsets: NDArray[np.int64]
    ) -> None:
        cells = ((size + side // 2) / side).at_least(1)
        part = line(graph, (size + (side - 1)) / side)
        same = graph.node("Equal", line(graph, cells).shaped(-1, 1), part.at_most(cells - 1))
        self.merge = same.cast("float32")
        start = part * side
        length = (start + side).at_most(size) - start
        of_parts = (length + (1 - offsets)[:, None]) / 2
        self.counts = of_parts.cast("float32") @ self.merge.turned(1, 0)


def _colours_of_sites() -> NDArray[np.float64]:
    """Return (4, 3, 4): of each place of red in a cell, 1 where a site holds a colour."""
    table = np.zeros((4, 3, 4))
    for phase, (red_y, red_x) in enumerate(PHASES):
        for site, (y, x) in enumerate(PHASES):
            table[phase, COLOURS[(y + red_y) % 2][(x + red_x) % 2], site] = 1
    return table


def sides_of(graph: GraphBuilder, planes: Value) -> list[Value]:
    """Return rows and columns of (..., rows, columns), (1,) int64 each."""
    sides = Value(graph, graph.node("Shape", planes, start=-2).name, "int64")
    return sides.parts(0, 2)


def haze_graph(facts: HazeFacts) -> GraphBuilder:
    """Return the graph of the gain and the veil of the cells of a capture."""
    graph, kernels, stage = GraphBuilder("haze"), facts.kernels, facts.stage
    means = graph.input("means", (3, "rows", "columns"))
    clipped = graph.input("clipped", (3, "rows", "columns"))
    axis = graph.input("axis_px", (2,), "float64")
    inner_sides = sides_of(graph, means)
    sides = tuple(side + 2 * MARGIN_CELLS for side in inner_sides)
    assert len(sides) == 2
    wide, narrow = few_of(kernels.coarse, stage.terms), few_of(kernels.coarse_core, CORE_TERMS)
    waves = CellWaves(graph, sides, wide[0].kernels.shape[-1] // 2)
    shares = _CellShares(graph, facts, sides, axis)
    mirrors = [_mirrored(graph, side) for side in inner_sides]

    def inner(picture: Value) -> Value:
        for number in (1, 2):
            picture = picture.part(number, MARGIN_CELLS, -MARGIN_CELLS)
        return picture

    def mirrored(cells: Value) -> Value:
        return cells.gather(mirrors[0], 1).gather(mirrors[1], 2)

    gains, veils, rises = [], [], []
    colours = zip(means.parts(0, 3), clipped.parts(0, 3), strict=True)
    for channel, (plane, mask) in enumerate(colours):
        blur = _Blur(graph, f"haze_{channel}", wide[channel], waves, shares)
        core = _Blur(graph, f"core_{channel}", narrow[channel], waves, shares)
        even, even_core = (inner(one.of_ones()).at_least(LEAST_RESPONSE) for one in (blur, core))
        undo = blur.solver()
        scene = mirrored(plane)
        for _ in range(stage.rounds):
            residual = plane - inner(blur(scene)) / even
            residual = residual + (residual * -1.0).relu() * mask
            scene = scene + undo(mirrored(residual))
        gain = even / even_core
        gains.append(gain)
        veils.append(inner(core(scene)) / even_core - gain * plane)
        rises.append(graph.node("ReduceMean", gain * gain, _AXES[2] + 1, keepdims=0))
    graph.output(CLEAR, graph.joined([*gains, *veils], axis=0), (6, "rows", "columns"))
    graph.output("noise_rise", graph.joined(rises, axis=0), (3,))
    return graph


def _mirrored(graph: GraphBuilder, count: Value) -> Value:
    """Return the numbers of the cells along a side with its margin, mirrored."""
    at = line(graph, count + 2 * MARGIN_CELLS) - MARGIN_CELLS
    period = (count * 2 - 2).at_least(1)
    remainder = graph.node("Mod", at, period)
    return remainder.at_most(period - remainder).at_most(count - 1)


class _CellShares:
    """The shares of the nodes whose kernels are known in every cell, see `lay_nodes`."""

    def __init__(
        self, graph: GraphBuilder, facts: HazeFacts, sides: tuple[Value, Value], axis: Value
    ) -> None:
        cell_px, heights = facts.kernels.cell_px, facts.kernels.core.field_heights_mm
        places = []
        for side, axis_place in zip(sides, axis.parts(0, 2)[::-1], strict=True):
            cell = (line(graph, side) - MARGIN_CELLS).cast("float64")
            place = (cell * float(cell_px) + ((cell_px - 1) / 2) - axis_place) * facts.pitch_mm
            places.append(place.cast("float32"))
        y, x = places[0].shaped(-1, 1), places[1]
        height = (x * x + y * y).sqrt()
        is_inside = graph.node("GreaterOrEqual", height, heights[1:-1, None, None]).cast("int64")
        low = graph.node("Squeeze", is_inside.sum(0), _AXES[1])
        widths = graph.constant(np.diff(heights))
        share = (height - graph.constant(heights).gather(low, 0)) / widths.gather(low, 0)
        share = share.clip(0.0, 1.0)
        turn = _turn(graph, x, y) * (AZIMUTHS / (2 * np.pi))
        first = turn.floor()
        right, at = turn - first, first.cast("int64")
        self._parts = []
        for step, of_row in ((0, 1.0 - share), (1, share)):
            for stride, of_column in ((0, 1.0 - right), (1, right)):
                azimuth = graph.node("Mod", at + stride, graph.constant(AZIMUTHS, "int64"))
                node = (low + (step - 1)) * AZIMUTHS + azimuth + 1
                self._parts.append((node.at_least(0), of_row * of_column))

    def of(self, weights: Value) -> Value:
        """Return weights (node, term) of every cell, (term, rows, columns)."""
        total: Value | None = None
        for node, share in self._parts:
            graph = share.graph
            part = weights.gather(node, 0) * graph.node("Unsqueeze", share, _AXES[1] + 2)
            total = part if total is None else total + part
        assert total is not None
        return total.turned(2, 0, 1)


def _turn(graph: GraphBuilder, x: Value, y: Value) -> Value:
    """Return the angle 0 .. 2 pi of places from +y towards +x."""
    x, y = x + y * 0.0, y + x * 0.0
    across, down = graph.node("Abs", x), graph.node("Abs", y)
    most = across.at_least(down).at_least(1e-30)
    angle = graph.node("Atan", across.at_most(down) / most)
    angle = graph.node("Where", across > down, np.pi / 2 - angle, angle)
    angle = graph.node("Where", y < 0.0, np.pi - angle, angle)
    return graph.node("Where", x < 0.0, 2 * np.pi - angle, angle)


class _Blur:
    """The blur of one colour in cells, see `camkit.runtime.bank.place_blur.PlaceBlur`."""

    def __init__(
        self,
        graph: GraphBuilder,
        name: str,
        few: FewKernels,
        waves: CellWaves,
        shares: _CellShares,
    ) -> None:
        self._graph, self._waves = graph, waves
        self._weights = shares.of(graph.table(f"{name}_weights", few.weights))
        kernels = graph.table(f"{name}_kernels", few.kernels)
        self._spectra = waves.kernel_spectrum(kernels, few.kernels.shape[-1] // 2)

    def __call__(self, light: Value) -> Value:
        """Return the blur of (1, h, w)."""
        return self._blurred(self._weights * light)

    def of_ones(self) -> Value:
        """Return the blur of a picture of ones."""
        return self._blurred(self._weights)

    def solver(self) -> "_Undo":
        """Return the Wiener filter of the mean kernel."""
        graph = self._graph
        share = graph.node("ReduceMean", self._weights, _AXES[2] + 1, keepdims=1)
        signs = [[(part * share).sum(0) for part in sign] for sign in self._spectra]
        return _Undo(
            waves=self._waves, mean=((signs[0][0], signs[0][1]), (signs[1][0], signs[1][1]))
        )

    def _blurred(self, parts: Value) -> Value:
        signs = []
        for lit, kernel in zip(self._waves.spectrum(parts), self._spectra, strict=True):
            re = (lit[0] * kernel[0] - lit[1] * kernel[1]).sum(0)
            signs.append((re, (lit[0] * kernel[1] + lit[1] * kernel[0]).sum(0)))
        return self._waves.picture((signs[0], signs[1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Undo:
    """The Wiener filter of a kernel."""

    waves: CellWaves
    mean: CellSpectrum

    def __call__(self, picture: Value) -> Value:
        """Return the filtered picture (1, h, w)."""
        signs = []
        for (re, im), (mean_re, mean_im) in zip(
            self.waves.spectrum(picture), self.mean, strict=True
        ):
            power = mean_re * mean_re + mean_im * mean_im + DAMPING
            real = (re * mean_re + im * mean_im) / power
            signs.append((real, (im * mean_re - re * mean_im) / power))
        return self.waves.picture((signs[0], signs[1]))


def cleared(graph: GraphBuilder, rgb: Value, shape: BlockShape, cell_px: int) -> Value:
    """Return the (3, 4, n, n) light of a block without its haze; adds the inputs that say how."""
    cells = graph.input(CLEAR, (6, "rows", "columns"))
    whole = shape.side + 2 * MARGIN_PX
    weights = []
    for axis, name in ((1, "row_index"), (2, "column_index")):
        index = graph.input(name, (whole,), "int64").part(0, MARGIN_PX, MARGIN_PX + shape.side)
        count = sides_of(graph, cells)[axis - 1]
        place = (index.cast("float32") + 0.5) * (1 / cell_px) - 0.5
        place = place.at_least(0.0).at_most((count - 1).cast("float32"))
        first, last = (
            graph.node(operator, place, _AXES[1], keepdims=1).floor().cast("int64")
            for operator in ("ReduceMin", "ReduceMax")
        )
        last = (last + 2).at_most(count)
        near = (line(graph, last - first) + first).cast("float32")
        weights.append((1.0 - graph.node("Abs", place.shaped(-1, 1) - near)).relu())
        cells = graph.node("Slice", cells, first, last, np.array([axis], np.int64))
    pixels = (weights[0] @ cells @ weights[1].turned(1, 0)).shaped(6, 1, shape.side, shape.side)
    gain, veil = graph.node("SpaceToDepth", pixels, blocksize=2).parts(0, 2)
    return rgb * gain + veil
