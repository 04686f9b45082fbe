"""Exact tiling: a network over a picture of any size, window by window, with the same bits.

One axis of a picture of n pixels, padded once at its far side to n' (a multiple of the stride s):

    0            p1                  p2                n'    output borders, all multiples of s
    |------------|-------------------|-----------------|
    [== kept ====:.halo.]                                    window 0, at 0
          [.halo.:======= kept ======:.halo.]                window 1, at p1 - halo
                              [.halo.:===== kept ======]     window 2, shifted inward to end at n'

All windows of a layout have one size and never reach past the padded picture, so the zeros that the
network's convolutions see lie at the picture's border only, as in the untiled run; each kept pixel
is at least `halo` away from every inner window border. With halo >= the network's reach, origins on
the lattice of its stride and kernels that sum alike wherever a pixel lies, kept pixels equal those
of the untiled run bit for bit. Nothing is blended.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Final, Protocol

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError, MemoryCapError
from camkit.runtime.cancel import Cancel, check_cancelled
from camkit.runtime.network.guard import TileGuard, is_finite
from camkit.runtime.network.light_keeper import WindowFinish
from camkit.runtime.network.row_buffer import RowBuffer
from camkit.runtime.rows import RowSource

DEFAULT_MAX_BYTES: Final = 640 * 2**20
FLOAT_BYTES: Final = 4
_MOST_COUNTS: Final = 64
PIECE_ROWS: Final = 64
"""A band is given away in pieces of about so many rows, each of which may be forgotten alone."""
BANDS_HELD: Final = 2
"""Output bands of a network in memory at a time: the one being filled, and no more than as much of
the one before, of which the next stage still needs some pieces."""

Run = Callable[[FloatArray], FloatArray]
Progress = Callable[[int, int], None]
"""Called with (work done, work in all)."""


class WindowRows(Protocol):
    """The padded rows around the windows in work."""

    def move_to(self, top: int) -> FloatArray:
        """Return the rows from `top` on, (c, rows, padded w); never above an earlier `top`."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """One window along one axis, in pixels of the padded picture.

    Attributes:
        origin_px: First pixel of the window.
        start_px: First pixel kept.
        stop_px: One past the last pixel kept.
    """

    origin_px: int
    start_px: int
    stop_px: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TileLayout:
    """Windows that cover a picture; see the drawing above.

    Attributes:
        height_px: Rows of the picture.
        width_px: Columns of the picture.
        stride_px: Total stride of the network.
        halo_px: Halo, a multiple of the stride.
        window_height_px: Rows of every window.
        window_width_px: Columns of every window.
        rows: Windows from top to bottom.
        columns: Windows from left to right.
    """

    height_px: int
    width_px: int
    stride_px: int
    halo_px: int
    window_height_px: int
    window_width_px: int
    rows: tuple[Span, ...]
    columns: tuple[Span, ...]

    def __post_init__(self) -> None:
        _check_axis(self.rows, self.window_height_px, self)
        _check_axis(self.columns, self.window_width_px, self)

    @property
    def padded_height_px(self) -> int:
        """Rows after padding to the stride."""
        return _ceil_to(self.height_px, self.stride_px)

    @property
    def padded_width_px(self) -> int:
        """Columns after padding to the stride."""
        return _ceil_to(self.width_px, self.stride_px)

    @property
    def window_count(self) -> int:
        """Number of runs of the network."""
        return len(self.rows) * len(self.columns)

    @property
    def work_ratio(self) -> float:
        """Computed pixels over picture pixels."""
        window = self.window_height_px * self.window_width_px
        return self.window_count * window / (self.height_px * self.width_px)

    def needed_bytes(self, cost: "PixelCost") -> int:
        """Estimate the memory of a run: one window and its arena, row buffer, output bands."""
        window = self.window_height_px, self.window_width_px
        band = max(span.stop_px - span.start_px for span in self.rows)
        return _needed_bytes(window, band, self.padded_width_px, cost)


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelCost:
    """The memory of a network per pixel of its input.

    Attributes:
        arena_bytes: Peak of its live activations.
        channels: Of its input.
        outputs: Channels of its output.
        scale: Samples along a side of the output for one pixel.
    """

    arena_bytes: float = 150.0
    channels: int = 6
    outputs: int = 3
    scale: int = 1

    @property
    def out_values(self) -> int:
        """Return the samples of the output for one pixel."""
        return self.outputs * self.scale * self.scale


def _needed_bytes(window: tuple[int, int], band: int, width_px: int, cost: PixelCost) -> int:
    row_bytes = FLOAT_BYTES * width_px
    ends = FLOAT_BYTES * (cost.channels + cost.out_values)
    arena = int(window[0] * window[1] * (cost.arena_bytes + ends))
    return arena + row_bytes * (cost.channels * window[0] + cost.out_values * BANDS_HELD * band)


def _check_axis(spans: tuple[Span, ...], window: int, layout: TileLayout) -> None:
    lattice = {layout.halo_px, window} | {v for s in spans for v in (s.origin_px, s.start_px)}
    if any(v % layout.stride_px for v in lattice):
        raise ContractError(f"halo, window and origins must be multiples of {layout.stride_px}")
    edges = [(a.stop_px, b.start_px) for a, b in pairwise(spans)]
    if any(a != b for a, b in edges) or any(s.start_px >= s.stop_px for s in spans):
        raise ContractError("windows must keep every pixel once, in order")


def _ceil_to(value: int, step: int) -> int:
    return -(-value // step) * step


def _window_count(size: int, window: int, halo: int) -> int:
    """Return how many windows of one size cover a padded axis."""
    return 1 if window >= size else -(-(size - 2 * halo) // (window - 2 * halo))


def _longest_span(size: int, window: int, halo: int) -> int:
    """Return the most pixels that a window of `_axis` keeps: the last one has one halo."""
    return size if window >= size else window - halo


def _axis(size: int, window: int, halo: int) -> tuple[Span, ...]:
    """Place windows of one size along a padded axis."""
    if window >= size:
        return (Span(origin_px=0, start_px=0, stop_px=size),)
    step, count = window - 2 * halo, _window_count(size, window, halo)
    origins = [min(i * step, size - window) for i in range(count)]
    starts = [0, *(origin + halo for origin in origins[1:])]
    stops = [*starts[1:], size]
    return tuple(
        Span(origin_px=o, start_px=a, stop_px=b)
        for o, a, b in zip(origins, starts, stops, strict=True)
    )


def _equal_window(size: int, count: int, halo: int, stride: int) -> int:
    """Return the smallest window of which `count` cover a padded axis."""
    return min(size, _ceil_to(-(-(size + (count - 1) * 2 * halo) // count), stride))


@dataclass(frozen=True, slots=True, kw_only=True)
class TileLimits:
    """The limits of a layout.

    Attributes:
        stride_px: Total stride of the network, >= 1.
        halo_px: Its reach, or less in fast mode; rounded up to the stride.
        cost: What the network holds per pixel.
        max_bytes: Cap on one window with its arena, the row buffer and one output band together.
        tile_px: Force output tiles of this side, or (height, width); None leaves it free.
        whole: One window whatever the size.
    """

    stride_px: int
    halo_px: int
    cost: PixelCost = PixelCost()
    max_bytes: int = DEFAULT_MAX_BYTES
    tile_px: int | tuple[int, int] | None = None
    whole: bool = False

    def __post_init__(self) -> None:
        if self.stride_px < 1 or self.halo_px < 0 or self.cost.arena_bytes <= 0:
            raise ContractError(
                "stride must be >= 1, halo >= 0 and bytes per pixel > 0; got "
                f"{self.stride_px}, {self.halo_px}, {self.cost.arena_bytes}"
            )
        if self.tile_px is not None and min(self.tile_sides_px) < 1:
            raise ContractError(f"tile_px must be >= 1; got {self.tile_px}")

    @property
    def tile_sides_px(self) -> tuple[int, int]:
        """Return height and width of the tiles that are forced; 0 where none are."""
        if isinstance(self.tile_px, tuple):
            return self.tile_px
        return self.tile_px or 0, self.tile_px or 0


def lay_windows(height_px: int, width_px: int, limits: TileLimits) -> TileLayout:
    """Plan the windows of a picture: the least computation that fits in the memory cap.

    Args:
        height_px: Rows of the picture, >= 1.
        width_px: Columns of the picture, >= 1.
        limits: Stride, halo and memory.

    Returns:
        The layout; it depends on nothing but the arguments.

    Raises:
        ContractError: If a side is < 1.
        MemoryCapError: If the smallest windows do not fit; it names what is enough.
    """
    if height_px < 1 or width_px < 1:
        raise ContractError(f"a picture has at least 1x1 pixels; got {width_px}x{height_px}")
    stride, halo = limits.stride_px, _ceil_to(limits.halo_px, limits.stride_px)
    size = _ceil_to(height_px, stride), _ceil_to(width_px, stride)
    if limits.tile_px is not None:
        height, width = (_ceil_to(side, stride) + 2 * halo for side in limits.tile_sides_px)
        window = min(size[0], height), min(size[1], width)
    else:
        window = _least_work(size, halo, limits)
    return TileLayout(
        height_px=height_px,
        width_px=width_px,
        stride_px=stride,
        halo_px=halo,
        window_height_px=window[0],
        window_width_px=window[1],
        rows=_axis(size[0], window[0], halo),
        columns=_axis(size[1], window[1], halo),
    )


def _least_work(size: tuple[int, int], halo: int, limits: TileLimits) -> tuple[int, int]:
    """Return the window of least computation within the cap; of equals, that of the fewest runs."""
    if limits.whole:
        heights, widths = {size[0]}, {size[1]}
    else:
        heights, widths = (_equal_windows(n, halo, limits.stride_px) for n in size)
    rows = {h: (_window_count(size[0], h, halo), _longest_span(size[0], h, halo)) for h in heights}
    columns = {w: _window_count(size[1], w, halo) for w in widths}
    costs = {
        (h, w): (
            down * across * h * w,
            down * across,
            _needed_bytes((h, w), band, size[1], limits.cost),
        )
        for h, (down, band) in rows.items()
        for w, across in columns.items()
    }
    fitting = [window for window in costs if costs[window][2] <= limits.max_bytes]
    if not fitting:
        least = min(memory for *_, memory in costs.values())
        raise MemoryCapError(
            f"{size[1]}x{size[0]} pixels with a halo of {halo} need at least "
            f"{least / 10**6:.0f} MB for one window; got {limits.max_bytes / 10**6:.0f} MB",
            math.ceil(least),
        )
    return min(fitting, key=lambda window: (costs[window], window))


def _equal_windows(size: int, halo: int, stride: int) -> set[int]:
    """Return the window sizes of which 1, 2, 3, ... cover a padded axis."""
    most = max(1, (size - 2 * halo) // stride)
    counts = {*range(1, min(most, _MOST_COUNTS) + 1), most}
    windows = {_equal_window(size, k, halo, stride) for k in counts}
    return {w for w in windows if w == size or w > 2 * halo}


def infer_bands(  # noqa: PLR0913
    run: Run,
    source: RowSource,
    layout: TileLayout,
    *,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
    guard: TileGuard | None = None,
    scale: int = 1,
    finish: WindowFinish | None = None,
    rows: WindowRows | None = None,
) -> Iterator[FloatArray]:
    """Run a network over a picture and yield its rows from top to bottom.

    Args:
        run: (1, c, h, w) float32 -> (1, k, s h, s w) float32, for the layout's window size.
        source: (c, h, w) picture; each of its rows is read once.
        layout: From `lay_windows`, for the size of the source.
        progress: Called as progress(done, total) after each window.
        cancel: Asked before each window.
        guard: Looks at every tile; None refuses NaN and inf only.
        scale: s, samples along a side of the output for one pixel of the input.
        finish: Changes the output of a window in place; it also sees all channels of the source.
        rows: Returns the padded rows of windows, where `run` reads the source by itself.

    Yields:
        (k, rows, s w) float32 pieces of bands, consecutive, together the whole picture.

    Raises:
        ContractError: If layout and source differ in size, or the network gives NaN or inf.
        Cancelled: If `cancel` said so.
    """
    channels, height, width = source.shape
    if (height, width) != (layout.height_px, layout.width_px):
        raise ContractError(
            f"the layout is for {layout.width_px}x{layout.height_px}, the picture {width}x{height}"
        )
    shape = (1, channels, layout.window_height_px, layout.window_width_px)
    window = np.empty(shape, np.float32) if len(layout.columns) > 1 else None
    padded = layout.padded_height_px, layout.padded_width_px
    buffer = rows or RowBuffer(source, layout.window_height_px, padded)
    count = 0
    for i, row in enumerate(layout.rows):
        band = buffer.move_to(row.origin_px)
        pieces: list[FloatArray] = []
        for j, column in enumerate(layout.columns):
            check_cancelled(cancel)
            filled = _filled(window, band, column.origin_px)
            output = run(filled)
            if finish is not None:
                finish(output[0], filled[0], _box(row, column, (height, width)))
            crop = _crop(output, row, column, (height, width), scale)
            if guard is not None:
                inputs = _crop(filled, row, column, (height, width))
                crop = guard.check(crop, inputs, partial(_describe, i, j, row, column))
            elif not is_finite(crop):
                raise ContractError(_not_finite_message(i, j, row, column))
            pieces = pieces or _pieces(crop.shape[0], crop.shape[1], scale * width)
            _fill(pieces, crop, scale * column.start_px)
            count += 1
            if progress is not None:
                progress(count, layout.window_count)
        del crop, output
        while pieces:  # the rows of the next windows are made before their band is
            yield pieces.pop(0)


def _pieces(outputs: int, rows: int, width: int) -> list[FloatArray]:
    """Return empty pieces of a band, (outputs, rows of the piece, width), from top to bottom."""
    cuts = [*range(0, rows, PIECE_ROWS), rows]
    return [np.empty((outputs, b - a, width), np.float32) for a, b in pairwise(cuts)]


def _fill(pieces: list[FloatArray], crop: FloatArray, column: int) -> None:
    """Copy what a window keeps to its columns of a band."""
    top = 0
    for piece in pieces:
        bottom = top + piece.shape[1]
        piece[:, :, column : column + crop.shape[2]] = crop[:, top:bottom]
        top = bottom


def _filled(window: FloatArray | None, rows: FloatArray, column: int) -> FloatArray:
    """Copy the columns of a window; a window as wide as the picture is the row buffer itself."""
    if window is None:
        return rows[None]
    np.copyto(window[0], rows[:, :, column : column + window.shape[3]])
    return window


def _crop(
    output: FloatArray, row: Span, column: Span, size: tuple[int, int], scale: int = 1
) -> FloatArray:
    """Crop the pixels that a window contributes; none lies in the padding."""
    top, left, bottom, right = _box(row, column, size)
    rows, columns = slice(scale * top, scale * bottom), slice(scale * left, scale * right)
    return output[0, :, rows, columns]


def _box(row: Span, column: Span, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return (top, left, bottom, right) of the kept pixels in their window."""
    return (
        row.start_px - row.origin_px,
        column.start_px - column.origin_px,
        min(row.stop_px, size[0]) - row.origin_px,
        min(column.stop_px, size[1]) - column.origin_px,
    )


def _not_finite_message(i: int, j: int, row: Span, column: Span) -> str:
    return (
        f"the network gave NaN or inf in {_describe(i, j, row, column)}; "
        "the input must be finite: repair dead pixels first"
    )


def _describe(i: int, j: int, row: Span, column: Span) -> str:
    return (
        f"tile (row {i}, column {j}), pixels x {column.start_px}..{column.stop_px}, "
        f"y {row.start_px}..{row.stop_px}"
    )
