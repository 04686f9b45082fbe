"""Networks on some lattice cells only: each chosen cell gets the bits of the untiled network.

    labels (row, column): 0 no network, n the n-th network
    strip of k cell rows -> rectangles of cells -> windows with halo -> kept cells
    elsewhere the planes that stand in for them, which the network's input holds anyway

       no network | network            inside a network's cell, over RAMP_PX from the border, the
                  |ramp|               result passes from the planes that stand in to the network's

A window reaches a halo beyond its cells (or to the picture's border) and reads the true input
there, so the pixels of its cells are those of the untiled run whatever rectangle they lie in; the
ramp depends on the labels alone. Strips and rectangles only decide what it costs.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError, MemoryCapError
from camkit.runtime.cancel import Cancel, check_cancelled
from camkit.runtime.network.guard import TileGuard, is_finite
from camkit.runtime.network.light_keeper import WindowFinish
from camkit.runtime.network.row_buffer import RowBuffer
from camkit.runtime.network.tiling import (
    PixelCost,
    Progress,
    Run,
)
from camkit.runtime.rows import RowSource

STRIPS_HELD: Final = 3
"""Strips of the output in memory at a time: one that is filled, one that is read, and what is still
needed of the one before."""
RAMP_PX: Final = 32
_CALL_PX: Final = 20_000
"""What starting a window costs, in pixels."""
_FLOAT_BYTES: Final = 4
_MOST_STRIP_CELLS: Final = 8

Labels = NDArray[np.integer]


@dataclass(frozen=True, slots=True, kw_only=True)
class CellNetwork:
    """One of the networks.

    Attributes:
        run: (1, c, h, w) float32 -> (1, 3, h, w) float32.
        stride_px: Sides of windows and their origins are multiples of it.
        halo_px: Its reach, or less in fast mode.
        cost: What it holds per pixel; its output has the grid of its input.
    """

    run: Run
    stride_px: int
    halo_px: int
    cost: PixelCost

    @property
    def window_bytes(self) -> float:
        """Return the memory of a window per pixel: activations, input and output."""
        return self.cost.arena_bytes + _FLOAT_BYTES * (self.cost.channels + self.cost.outputs)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellLimits:
    """The limits of a layout.

    Attributes:
        cell_px: Side of a lattice cell.
        max_bytes: Cap on the rows held, one output strip and the largest window of every network.
        tile_px: Force strips and windows of about this size (tests); None takes what fits.
    """

    cell_px: int
    max_bytes: int
    tile_px: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CellWindow:
    """One run of a network.

    Attributes:
        network: Which, from 0.
        cells: Rows and columns of the lattice that it covers: (top, left, bottom, right).
        pixels: The window on the padded picture: (top, left, bottom, right).
    """

    network: int
    cells: tuple[int, int, int, int]
    pixels: tuple[int, int, int, int]

    @property
    def area_px(self) -> int:
        """Return the pixels computed."""
        top, left, bottom, right = self.pixels
        return (bottom - top) * (right - left)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellLayout:
    """Windows for the cells of a picture.

    Attributes:
        size_px: (height, width) of the picture.
        padded_px: The same after padding to the strides.
        cell_px: Side of a cell.
        labels: (row, column), 0 none, n the n-th network.
        strip_cells: Cell rows per strip.
        halo_px: Rows held above and below a strip.
        strips: Windows of every strip, from top to bottom.
    """

    size_px: tuple[int, int]
    padded_px: tuple[int, int]
    cell_px: int
    labels: Labels
    strip_cells: int
    halo_px: int
    strips: tuple[tuple[CellWindow, ...], ...]

    @property
    def window_count(self) -> int:
        """Number of runs of networks."""
        return sum(len(windows) for windows in self.strips)

    @property
    def buffer_rows(self) -> int:
        """Rows of the padded picture held at a time."""
        return min(self.padded_px[0], self.strip_cells * self.cell_px + 2 * self.halo_px)

    def needed_bytes(self, costs: Sequence[PixelCost]) -> int:
        """Estimate the memory: rows and output strips held, every network's largest window."""
        width = self.padded_px[1]
        strips = STRIPS_HELD * self.strip_cells * self.cell_px
        ends = costs[0] if costs else PixelCost()
        row_bytes = (
            _FLOAT_BYTES * (ends.channels * self.buffer_rows + ends.outputs * strips) * width
        )
        largest = [0] * len(costs)
        for windows in self.strips:
            for window in windows:
                largest[window.network] = max(largest[window.network], window.area_px)
        return row_bytes + int(
            sum(
                area * (cost.arena_bytes + _FLOAT_BYTES * (cost.channels + cost.outputs))
                for area, cost in zip(largest, costs, strict=True)
            )
        )

    def area_px(self, network: int) -> int:
        """Return the pixels that one network computes."""
        return sum(w.area_px for ws in self.strips for w in ws if w.network == network)


def lay_cells(
    size_px: tuple[int, int],
    labels: Labels,
    networks: Sequence[CellNetwork],
    limits: CellLimits,
) -> CellLayout:
    """Plan the windows for the chosen cells, the least computation that fits in the cap.

    Args:
        size_px: (height, width) of the picture.
        labels: (row, column) of its lattice: 0 none, n the n-th of `networks`.
        networks: Strides, halos and memory.
        limits: Cell side and memory.

    Raises:
        ContractError: If the labels do not fit the picture.
        MemoryCapError: If the memory is too small for one cell; it names what is enough.
    """
    cell = limits.cell_px
    lattice = tuple(-(-side // cell) for side in size_px)
    if labels.shape != lattice or labels.min() < 0 or labels.max() > len(networks):
        raise ContractError(
            f"a picture of {size_px} px has {lattice} cells with labels 0..{len(networks)}; "
            f"got {labels.shape}"
        )
    stride = int(np.lcm.reduce([n.stride_px for n in networks] or [1]))
    halo = max((_ceil_to(n.halo_px, stride) for n in networks), default=0)
    padded = _ceil_to(size_px[0], stride), _ceil_to(size_px[1], stride)
    frame = _Frame(cell=cell, stride=stride, padded=padded)
    strip, most_px = _strip_cells(frame, networks, halo, limits)
    strips = []
    for top in range(0, lattice[0], strip):
        part = labels[top : top + strip]
        windows = [
            frame.window(i, (top + a, b, top + c, d), _ceil_to(network.halo_px, stride))
            for i, network in enumerate(networks)
            for a, b, c, d in _cover(
                part == i + 1, cell, _ceil_to(network.halo_px, stride), most_px
            )
        ]
        strips.append(tuple(windows))
    return CellLayout(
        size_px=size_px,
        padded_px=padded,
        cell_px=cell,
        labels=labels,
        strip_cells=strip,
        halo_px=halo if cell % stride == 0 else halo + stride,
        strips=tuple(strips),
    )


def infer_cells(
    networks: Sequence[CellNetwork],
    source: RowSource,
    layout: CellLayout,
    *,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
    guard: TileGuard | None = None,
    stand_in: slice,
    finish: WindowFinish | None = None,
) -> Iterator[FloatArray]:
    """Run the networks on their cells and yield the rows of the picture from top to bottom.

    Args:
        networks: Those of the layout.
        source: (c, h, w) picture as the networks take it; rows are read once.
        layout: From `lay_cells`.
        progress: Called as progress(done, total) after each window.
        cancel: Asked before each window.
        guard: Looks at every window; None refuses NaN and inf only.
        stand_in: Channels of the source that stand where no network runs.
        finish: Changes the output of a window in place; it also sees all channels of the source.

    Yields:
        (k, rows, w) float32, consecutive.

    Raises:
        ContractError: If layout and source differ in size, or a network gives NaN or inf.
        Cancelled: If `cancel` said so.
    """
    _, height, width = source.shape
    if (height, width) != layout.size_px:
        raise ContractError(f"the layout is for {layout.size_px}, the picture {height, width}")
    buffer = RowBuffer(source, layout.buffer_rows, layout.padded_px)
    count = 0
    for number, windows in enumerate(layout.strips):
        top = number * layout.strip_cells * layout.cell_px
        bottom = min(top + layout.strip_cells * layout.cell_px, height)
        first = max(0, min(top - layout.halo_px, layout.padded_px[0] - layout.buffer_rows))
        rows = buffer.move_to(first)
        band = rows[stand_in, top - first : bottom - first, :width].copy()
        for window in windows:
            check_cancelled(cancel)
            y0, x0, y1, x1 = window.pixels
            inputs = np.ascontiguousarray(rows[None, :, y0 - first : y1 - first, x0:x1])
            output = networks[window.network].run(inputs)
            if finish is not None:
                finish(output[0], inputs[0], _kept_box(window, layout))
            planes = _checked(output, inputs, window, guard)
            _place(planes, window, layout, band, top)
            count += 1
            if progress is not None:
                progress(count, layout.window_count)
        yield band
        del band  # the rows of the next windows are made before their band is


def _checked(
    output: FloatArray, inputs: FloatArray, window: CellWindow, guard: TileGuard | None
) -> FloatArray:
    """Return (3, h, w) of a window's output if it is sound."""
    describe = partial(_describe, window)
    if guard is not None:
        return guard.check(output[0], inputs[0], describe)
    if not is_finite(output[0]):
        raise ContractError(
            f"the network gave NaN or inf in {describe()}; the input must be finite: repair dead "
            "pixels first"
        )
    return np.asarray(output[0])


def _kept_box(window: CellWindow, layout: CellLayout) -> tuple[int, int, int, int]:
    """Return (top, left, bottom, right) of the pixels of a window that its cells cover."""
    cell, (height, width) = layout.cell_px, layout.size_px
    top, left, bottom, right = (edge * cell for edge in window.cells)
    y, x = window.pixels[:2]
    return top - y, left - x, min(bottom, height) - y, min(right, width) - x


def _describe(window: CellWindow) -> str:
    top, left, bottom, right = window.pixels
    return f"window x {left}..{right}, y {top}..{bottom}"


def _place(
    planes: FloatArray, window: CellWindow, layout: CellLayout, band: FloatArray, band_top: int
) -> None:
    """Copy the cells of a window into the band, with a ramp where a neighbour has no network."""
    top, left, bottom, right = window.cells
    cell, (height, width) = layout.cell_px, layout.size_px
    origin_y, origin_x = window.pixels[:2]
    active = np.pad(layout.labels > 0, 1, mode="edge")
    for i in range(top, bottom):
        for j in range(left, right):
            if layout.labels[i, j] != window.network + 1:
                continue
            y0, x0 = i * cell, j * cell
            y1, x1 = min(y0 + cell, height), min(x0 + cell, width)
            new = planes[:, y0 - origin_y : y1 - origin_y, x0 - origin_x : x1 - origin_x]
            old = band[:, y0 - band_top : y1 - band_top, x0:x1]
            neighbours = active[i : i + 3, j : j + 3]
            if neighbours.all():
                old[...] = new
                continue
            weight = _ramp(tuple(map(bool, neighbours.ravel())), cell)[: y1 - y0, : x1 - x0]
            # Where the weight is 1 the network's own bits are kept.
            old[...] = np.where(weight < 1, old + weight * (new - old), new)


@lru_cache(maxsize=256)
def _ramp(neighbours: tuple[bool, ...], cell_px: int) -> FloatArray:
    """Return (cell, cell) weights: distance to the nearest cell without network over RAMP_PX.

    Args:
        neighbours: Which of the 3x3 cells have a network, in reading order.
        cell_px: Side of a cell.
    """
    at = np.arange(cell_px, dtype=np.float32) + np.float32(0.5)
    distances = {-1: at, 0: np.zeros_like(at), 1: at[::-1]}
    distance = np.full((cell_px, cell_px), np.inf, dtype=np.float32)
    for index, has_network in enumerate(neighbours):
        dy, dx = index // 3 - 1, index % 3 - 1
        if not has_network:
            distance = np.minimum(distance, np.maximum(distances[dy][:, None], distances[dx]))
    ramp = np.clip(distance / np.float32(RAMP_PX), 0, 1)
    weights = np.asarray(ramp * ramp * (3 - 2 * ramp), dtype=np.float32)
    weights.flags.writeable = False
    return weights


@dataclass(frozen=True, slots=True, kw_only=True)
class _Frame:
    """The lattice on the padded picture."""

    cell: int
    stride: int
    padded: tuple[int, int]

    def window(self, network: int, cells: tuple[int, int, int, int], halo: int) -> CellWindow:
        """Return the window that serves a rectangle of cells."""
        top, left, bottom, right = (edge * self.cell for edge in cells)
        height, width = self.padded
        return CellWindow(
            network=network,
            cells=cells,
            pixels=(
                max(_floor_to(top - halo, self.stride), 0),
                max(_floor_to(left - halo, self.stride), 0),
                min(_ceil_to(bottom + halo, self.stride), height),
                min(_ceil_to(right + halo, self.stride), width),
            ),
        )


def _strip_cells(
    frame: _Frame, networks: Sequence[CellNetwork], halo: int, limits: CellLimits
) -> tuple[int, int]:
    """Return cell rows per strip and the most pixels of a window, by the memory cap."""
    cell, (height, width) = frame.cell, frame.padded
    rows = -(-height // cell)
    per_px = sum(network.window_bytes for network in networks)
    ends = networks[0].cost if networks else PixelCost()
    in_bytes, out_bytes = _FLOAT_BYTES * ends.channels, _FLOAT_BYTES * ends.outputs
    if limits.tile_px is not None:
        cells = min(max(1, -(-limits.tile_px // cell)), rows)
        return cells, _padded_px(cell, cells, cells, halo)
    for cells in range(min(_MOST_STRIP_CELLS, rows), 0, -1):
        row_bytes = min(height, cells * cell + 2 * halo) * width * in_bytes
        row_bytes += cells * cell * width * out_bytes
        most_px = int((limits.max_bytes - row_bytes) / max(per_px, 1))
        if most_px >= _padded_px(cell, cells, min(2, cells), halo):
            return cells, most_px
    need = math.ceil(row_bytes + _padded_px(cell, 1, 1, halo) * max(per_px, 1)) + 1
    raise MemoryCapError(
        f"{width}x{height} pixels with a halo of {halo} need at least {need / 10**6:.0f} MB for "
        f"one cell; got {limits.max_bytes / 10**6:.0f} MB",
        need,
    )


def _padded_px(cell: int, rows: int, columns: int, halo: int) -> int:
    return (rows * cell + 2 * halo) * (columns * cell + 2 * halo)


def _cover(
    mask: NDArray[np.bool_], cell: int, halo: int, most_px: int
) -> list[tuple[int, int, int, int]]:
    """Cover the chosen cells by rectangles (top, left, bottom, right), cut where it saves most."""
    box = _box(mask, (0, 0, *mask.shape))
    if box is None:
        return []
    boxes, open_boxes = [], [box]
    while open_boxes:
        box = open_boxes.pop()
        parts = _best_cut(mask, box, cell, halo, most_px)
        if parts:
            open_boxes.extend(reversed(parts))
        else:
            boxes.append(box)
    return boxes


def _best_cut(
    mask: NDArray[np.bool_], box: tuple[int, int, int, int], cell: int, halo: int, most_px: int
) -> list[tuple[int, int, int, int]]:
    """Return the parts of the cheapest cut of a rectangle, nothing if it is best left whole."""
    top, left, bottom, right = box
    whole = _work_px(box, cell, halo)
    must = whole - _CALL_PX > most_px
    if not must and mask[top:bottom, left:right].all():
        return []
    cuts = [((top, left, y, right), (y, left, bottom, right)) for y in range(top + 1, bottom)]
    cuts += [((top, left, bottom, x), (top, x, bottom, right)) for x in range(left + 1, right)]
    best: tuple[int, int, list[tuple[int, int, int, int]]] | None = None
    for pair in cuts:
        parts = [part for half in pair if (part := _box(mask, half)) is not None]
        sizes = [_work_px(part, cell, halo) for part in parts]
        # Of equal cuts the one into equal halves, so that few shapes occur.
        rated = (sum(sizes), max(sizes), parts)
        if best is None or rated[:2] < best[:2]:
            best = rated
    if best is None or not (must or best[0] < whole):
        return []
    return best[2]


def _box(
    mask: NDArray[np.bool_], box: tuple[int, int, int, int]
) -> tuple[int, int, int, int] | None:
    """Return the smallest rectangle around the chosen cells of a rectangle."""
    top, left, bottom, right = box
    rows, columns = np.nonzero(mask[top:bottom, left:right])
    if rows.size == 0:
        return None
    return (
        top + int(rows.min()),
        left + int(columns.min()),
        top + int(rows.max()) + 1,
        left + int(columns.max()) + 1,
    )


def _work_px(box: tuple[int, int, int, int], cell: int, halo: int) -> int:
    top, left, bottom, right = box
    return _padded_px(cell, bottom - top, right - left, halo) + _CALL_PX


def _ceil_to(value: int, step: int) -> int:
    return -(-value // step) * step


def _floor_to(value: int, step: int) -> int:
    return value // step * step
