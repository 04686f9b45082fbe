"""A picture in overlapping blocks, each restored with the PSF of its own place, added in order.

    rows -> blocks, mirrored past the borders -> any block filter -> window -> sum -> bands

The grid depends on the picture size, block and overlap alone; the blocks are added row by row
from left to right, whatever thread restored them, so the bits depend on nothing else.

       |<---- block ---->|
       |          |<- overlap ->|          over the overlap the window of each block is zero in
       |                 |                 the outer quarter, one in the inner, sin^2 between
                  |<---- block ---->|
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.bank.psf import FieldKernels
from camkit.runtime.bank.spectrum import ComplexArray, apply_transfer, transform
from camkit.runtime.binning import Binning, waves
from camkit.runtime.cancel import Cancel, check_cancelled
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.rows import ArrayRows, RowSource

MaskRows = Callable[[int, int], NDArray[np.bool_]]

TAPER_SHRINK: Final = 4
"""The taper blends to a blurred block that is computed at this fraction of its size."""

UNCUT_PX: Final = 512
"""Blocks up to this side stay as they are, however small the picture."""

BORDER_SHARE: Final = 7 / 16
"""Mirrored border around the picture, as a share of the overlap."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """The inputs of a block filter.

    Attributes:
        samples: (c, b, b) float32, the blurred picture, made periodic by `taper_edges`.
        otf: (c, b, b // 2 + 1) complex64, the local PSF's; its centre is the origin.
        unknown: (1 or c, b, b), true where the sensor clipped; None if nowhere.
        height_mm: Field height of its place.
        knowledge: What `PlaceKnowledge` gave for that place, where the bank has one.
        red: (row, column) of red in the first cell of the mosaic that the samples were made of;
            None for none, or an odd side, whose cells do not repeat.
    """

    samples: FloatArray
    otf: ComplexArray
    unknown: NDArray[np.bool_] | None = None
    height_mm: float = 0.0
    knowledge: object = None
    red: tuple[int, int] | None = None


BlockFilter = Callable[[Block], FloatArray]
PlaceKnowledge = Callable[[ComplexArray, float], object]
"""(OTF, field height in mm) -> what a filter knows of a place before it sees a block there."""


class KernelChoice(Protocol):
    """Several kernels of a camera, one of them for every place of a capture."""

    def number_at(self, x_px: float, y_px: float) -> int:
        """Return the number of the kernels that a pixel position of the capture has."""

    def kernels_of(self, number: int) -> FieldKernels:
        """Return the kernels of a number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalPsf:
    """The kernels of a camera and where the capture lies on its sensor.

    Attributes:
        kernels: Of `camkit.runtime.bank.psf.color_kernels`.
        window: Place of the capture on the sensor.
        choice: Kernels that differ from place to place, of fields and sides as `kernels`; None for
            `kernels` everywhere.
        binning: Squares that the pixels of the window are means over; kernels are those of the
            pixels before. None for none.
    """

    kernels: FieldKernels
    window: SensorWindow
    choice: KernelChoice | None = None
    binning: Binning | None = None

    @property
    def channels(self) -> int:
        """Return the number of channels."""
        return int(self.kernels.kernels.shape[1])

    def position_mm(self, x_px: float, y_px: float) -> tuple[float, float]:
        """Return the sensor position of a pixel position of the capture."""
        x_mm, y_mm = self.window.to_mm(x_px, y_px)
        return float(x_mm), float(y_mm)

    def number_at(self, x_px: float, y_px: float) -> int:
        """Return the number of the kernels of the choice that a pixel position has."""
        return 0 if self.choice is None else self.choice.number_at(x_px, y_px)

    def kernels_of(self, number: int) -> FieldKernels:
        """Return the kernels of a number."""
        return self.kernels if self.choice is None else self.choice.kernels_of(number)

    def otf_of(self, number: int, place_mm: tuple[float, float], block_px: int) -> ComplexArray:
        """Return the OTF of the kernels of a number, at a place, on a periodic block."""
        kernel = self.kernels_of(number).at(*place_mm)
        if self.binning is None:
            return to_otf(kernel, block_px)
        return binned_otf(kernel, block_px, self.binning)


@dataclass(frozen=True, slots=True)
class Span:
    """One block along one axis.

    Attributes:
        start: First sample, negative where the block begins before the picture.
        inner: Slice of the block in which its window is not zero and the picture exists.
        weights: The window over `inner`.
        centre: Middle of `inner` in picture pixels.
        index: Picture index of every sample of the block, mirrored past the borders.
    """

    start: int
    inner: slice
    weights: FloatArray
    centre: float
    index: NDArray[np.intp]


PlainBlock = Callable[[Span, Span], bool]


def lay_spans(size_px: int, block_px: int, overlap_px: int) -> tuple[Span, ...]:
    """Cover an axis with blocks, centred, the least number that leaves a mirrored border.

    Args:
        size_px: Samples of the picture along the axis.
        block_px: Length of a block.
        overlap_px: Overlap of neighbours, at most half a block.

    Raises:
        ContractError: If the sizes cannot make a grid.
    """
    if size_px < 1 or not 0 <= 2 * overlap_px <= block_px or block_px < 1:
        raise ContractError(
            "blocks need a picture of at least one pixel and an overlap of half a block at most; "
            f"got size {size_px}, block {block_px}, overlap {overlap_px}"
        )
    step = block_px - overlap_px
    border = int(overlap_px * BORDER_SHARE)
    count = max(1, -(-(size_px + 2 * border - overlap_px) // step))
    first = -((count * step + overlap_px - size_px) // 2)
    rise = _rise(overlap_px)
    spans = []
    for i in range(count):
        weights = np.ones(block_px, dtype=np.float32)
        if i > 0:
            weights[:overlap_px] = rise
        if i < count - 1:
            weights[block_px - overlap_px :] = rise[::-1]
        spans.append(_clip_span(first + i * step, weights, size_px))
    return tuple(spans)


def cut_block_px(block_px: int, overlap_px: int, size_px: tuple[int, int]) -> int:
    """Return the side of the blocks of a picture: none much larger than the picture is.

    Args:
        block_px: As the bundle states it.
        overlap_px: Overlap of neighbours.
        size_px: Two sides of the picture.
    """
    border = int(overlap_px * BORDER_SHARE)
    covering = cv2.getOptimalDFTSize(max(size_px) + 2 * border + TAPER_SHRINK)
    covering += -covering % TAPER_SHRINK
    return min(block_px, max(covering, UNCUT_PX, 2 * overlap_px))


def _rise(overlap_px: int) -> FloatArray:
    """Return a rise: zero over a quarter of the overlap, sin^2 over its half, then one."""
    t = (np.arange(overlap_px) + 0.5 - overlap_px / 4) / max(overlap_px / 2, 0.5)
    return np.asarray(np.sin(np.pi / 2 * np.clip(t, 0, 1)) ** 2, dtype=np.float32)


def _clip_span(start: int, weights: FloatArray, size_px: int) -> Span:
    live = np.flatnonzero(weights)
    low, high = max(int(live[0]), -start), min(int(live[-1]) + 1, size_px - start)
    at = np.arange(start, start + weights.size)
    period = max(2 * (size_px - 1), 1)
    folded = at % period
    return Span(
        start=start,
        inner=slice(low, high),
        weights=weights[low:high],
        centre=start + (low + high - 1) / 2,
        index=np.minimum(folded, period - folded) if size_px > 1 else np.zeros_like(at),
    )


def to_otf(kernel: FloatArray, block_px: int) -> ComplexArray:
    """Transform a (c, kh, kw) kernel to its OTF on a periodic block.

    Returns:
        (c, b, b // 2 + 1) complex64; the kernel's centre is the origin.

    Raises:
        ContractError: If the kernel is larger than the block.
    """
    channels, kh, kw = kernel.shape
    if max(kh, kw) > block_px:
        raise ContractError(f"a kernel of {kh}x{kw} px does not fit a block of {block_px} px")
    block = np.zeros((channels, block_px, block_px), dtype=np.float32)
    down, across = kh // 2, kw // 2
    for rows, kernel_rows in _halves(kh, down):
        for cols, kernel_cols in _halves(kw, across):
            block[:, rows, cols] = kernel[:, kernel_rows, kernel_cols]
    return transform(block)


def binned_otf(kernel: FloatArray, block_px: int, binning: Binning) -> ComplexArray:
    """Transform a (c, kh, kw) kernel to the OTF between means over squares.

    It leads from the picture averaged over squares to what is recorded of it in each colour; what
    lies beyond the finest detail of such a picture is left out.

    Args:
        kernel: In pixels before they are averaged.
        block_px: Side of the block, in squares.
        binning: The squares.

    Returns:
        (c, b, b // 2 + 1) complex64.
    """
    side = binning.side_px
    down, across = np.fft.fftfreq(block_px) / side, np.fft.rfftfreq(block_px) / side
    height, width = kernel.shape[-2:]
    rows = waves(np.arange(height) - height // 2, -down).astype(np.complex64)
    columns = waves(np.arange(width) - width // 2, -across).T.astype(np.complex64)
    otf = np.empty((kernel.shape[0], block_px, across.size), np.complex64)
    for channel, plane in enumerate(kernel):
        otf[channel] = rows @ plane.astype(np.complex64) @ columns
        otf[channel] *= binning.transfer(channel, down)[:, None].astype(np.float32)
        otf[channel] *= binning.transfer(channel, across).astype(np.float32)
    return otf


def _halves(length: int, middle: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return (in the block, in the kernel) of what lies from the centre on, and before it."""
    tail = slice(-middle, None) if middle else slice(0, 0)
    return (slice(0, length - middle), slice(middle, None)), (tail, slice(0, middle))


def mirror_otf(otf: ComplexArray, *, flip_x: bool, flip_y: bool) -> ComplexArray:
    """Return the OTF of the kernel mirrored left-right and/or up-down."""
    if flip_x != flip_y:
        turned = np.empty_like(otf)
        turned[:, 0] = otf[:, 0]
        turned[:, 1:] = otf[:, :0:-1]
        return np.conj(turned, out=turned) if flip_x else turned
    return np.asarray(np.conj(otf)) if flip_x else otf


def taper_edges(samples: FloatArray, otf: ComplexArray, ring_px: int) -> FloatArray:
    """Blend the outer ring of a block to its own periodic blur.

    A block cut from a larger picture is no periodic blur of anything: light crosses its edges.
    Deconvolved as it is, the jump rings through the whole block wherever the OTF is small.

    Args:
        samples: (c, b, b) float32.
        otf: (c, b, b // 2 + 1) complex64.
        ring_px: Width of the ring; 0 leaves the block as it is.

    References: Reeves 2005 (edge taper as pre-processing).
    """
    size = samples.shape[-1]
    ring = min(ring_px, size // 4)
    if ring == 0:
        return samples
    shrink = TAPER_SHRINK if size % TAPER_SHRINK == 0 else 1
    tapered = np.array(samples)  # first of all: a mirrored block is slow to read
    small = _shrink(_shrink(tapered, shrink, axis=1), shrink, axis=2)
    n = size // shrink
    half = otf[:, :, : n // 2 + 1]
    low = np.concatenate([half[:, : n - n // 2], half[:, size - n // 2 :]], axis=1)
    blurred = apply_transfer(small, low)
    keep = taper_weights(size, ring)
    inner = slice(ring, size - ring)
    for rows, cols in (
        (slice(0, ring), slice(0, size)),
        (slice(size - ring, size), slice(0, size)),
        (inner, slice(0, ring)),
        (inner, slice(size - ring, size)),
    ):
        part = _grow(blurred, shrink, rows, cols)
        ringed = tapered[:, rows, cols]
        ringed -= part
        ringed *= keep[rows, cols]
        ringed += part
    return tapered


def _grow(small: FloatArray, factor: int, rows: slice, cols: slice) -> FloatArray:
    """Repeat every sample `factor` times along both axes, for these rows and columns only."""
    down, across = (np.arange(s.start, s.stop) // factor for s in (rows, cols))
    wide = np.asarray(small[:, down[0] : down[-1] + 1]).take(across, axis=2)
    return np.asarray(wide.take(down - down[0], axis=1))


def _shrink(planes: FloatArray, factor: int, *, axis: int) -> FloatArray:
    """Average every `factor` rows (axis 1) or columns (axis 2)."""
    leading_axes = (slice(None),) * axis
    total = np.array(planes[(*leading_axes, slice(None, None, factor))])
    for i in range(1, factor):
        total += planes[(*leading_axes, slice(i, None, factor))]
    total *= np.float32(1 / factor)
    return total


@lru_cache(maxsize=4)
def taper_weights(size_px: int, ring_px: int) -> FloatArray:
    """Return (b, b): 1 inside, falling as sin^2 to 0 over the ring."""
    line = np.ones(size_px, dtype=np.float32)
    line[:ring_px] = np.sin(np.pi / 2 * (np.arange(ring_px) + 0.5) / ring_px) ** 2
    line = np.minimum(line, line[::-1])
    weights = np.asarray(line[:, None] * line)
    weights.flags.writeable = False
    return weights


_Millimetres = tuple[float, float]
"""Position (x, y) on the sensor."""


class BlockBank:
    """Restores pictures block by block with the PSF of each block's place; immutable."""

    def __init__(
        self,
        psf: LocalPsf,
        block_filter: BlockFilter,
        *,
        block_px: int,
        overlap_px: int,
        threads: int = 1,
        knowledge: PlaceKnowledge | None = None,
        red: tuple[int, int] | None = None,
    ) -> None:
        """Plan the grid.

        Args:
            psf: Kernels and place of the capture.
            block_filter: Restores one block.
            block_px: Side of a block, at least that of the kernels.
            overlap_px: Overlap of neighbouring blocks.
            threads: Blocks restored at a time; no influence on the bits.
            knowledge: Made once for a place and those that mirror it; their blocks are mirrored
                then, not their OTF.
            red: (row, column) of red in the first cell of the picture's mosaic; None for none.
        """
        has_cells = block_px % 2 == 0 and min(psf.window.size_px) > 1
        self._red = red if has_cells else None
        self._knowledge = knowledge
        self._psf = psf
        self._filter = block_filter
        self._block_px = block_px
        self._guard_px = overlap_px // 4
        self._threads = threads
        self._columns = lay_spans(psf.window.size_px[0], block_px, overlap_px)
        self._rows = lay_spans(psf.window.size_px[1], block_px, overlap_px)

    def restore_array(
        self, planes: FloatArray, saturated: NDArray[np.bool_] | None = None
    ) -> FloatArray:
        """Restore a whole (c, h, w) picture; `saturated` is (h, w) or (c, h, w)."""
        mask = None if saturated is None else lambda top, bottom: saturated[..., top:bottom, :]
        return np.concatenate(list(self.restore_bands(ArrayRows(planes), mask)), axis=1)

    def restore_bands(
        self,
        source: RowSource,
        saturated: MaskRows | None = None,
        plain: PlainBlock | None = None,
        cancel: Cancel | None = None,
    ) -> Iterator[FloatArray]:
        """Restore a picture from top to bottom.

        Args:
            source: (c, h, w) rows, linear, of the size the bank was laid out for.
            saturated: Gives the clipped samples of rows top..bottom, (rows, w) or (c, rows, w);
                asked after those rows were read.
            plain: Tells which blocks, given as (row span, column span), stay as they are.
            cancel: Asked before every block.

        Yields:
            (c, rows, w) float32, consecutive.

        Raises:
            ContractError: If the source has another size.
            Cancelled: If `cancel` said so.
        """
        width, height = self._psf.window.size_px
        channels = self._psf.channels
        if source.shape != (channels, height, width):
            raise ContractError(
                f"the bank is for ({channels}, {height}, {width}); got {source.shape}"
            )
        tops = [int(span.index.min()) for span in self._rows]
        total = np.zeros((channels, 0, width), dtype=np.float32)
        first_row = 0
        for i, span in enumerate(self._rows):
            top, bottom = min(tops[i:]), int(span.index.max()) + 1
            index = span.index - top
            rows = _select(source.read(top, bottom), index, axis=1)
            mask = None if saturated is None else saturated(top, bottom)
            mask = None if mask is None else _select(mask, index, axis=mask.ndim - 2)
            strip = _Strip(rows, mask, span, plain, self._red)
            total = _lengthened(total, span.start + span.inner.stop - first_row)
            self._add_blocks(strip, total[:, span.start + span.inner.start - first_row :], cancel)
            # What is not needed again must not wait here while the network works.
            del strip, rows, mask
            last = i + 1 == len(self._rows)
            ready = height if last else self._rows[i + 1].start + self._rows[i + 1].inner.start
            finished, total = (
                total[:, : ready - first_row].copy(),
                total[:, ready - first_row :].copy(),
            )
            first_row = ready
            yield finished
            del finished

    def _add_blocks(self, strip: "_Strip", total: FloatArray, cancel: Cancel | None) -> None:
        """Add the windowed blocks of one block row to its rows, from left to right."""
        # The threads end with the block row: a generator that waits for its next reader must not
        # own any, since the garbage collector may close it while another thread is starting.
        with ThreadPoolExecutor(self._threads) as pool:
            restored = self._restore(strip, pool, cancel)
            for column, part in zip(self._columns, restored, strict=True):
                x = column.start + column.inner.start
                total[:, :, x : x + part.shape[2]] += part

    def _restore(
        self, strip: "_Strip", pool: ThreadPoolExecutor, cancel: Cancel | None
    ) -> Iterator[FloatArray]:
        """Yield the windowed blocks of one block row, from left to right."""
        groups = self._groups(strip)
        blocks: dict[int, Future[FloatArray]] = {}

        def restore(
            number: int, place_mm: _Millimetres, future_place: Future[_Place] | None
        ) -> FloatArray:
            check_cancelled(cancel)
            column = self._columns[number]
            window = strip.span.weights[:, None] * column.weights
            if future_place is None:
                return strip.cut(column)[0][:, strip.span.inner, column.inner] * window
            sharp = self._filtered(strip.cut(column), future_place.result(), place_mm)
            return sharp[:, strip.span.inner, column.inner] * window

        # The pool takes tasks in order: a place is made one group ahead, so that no block waits
        # for one that nobody is making, and forgotten with its last block.
        keys = iter(groups)
        following = self._begin(next(keys), pool)
        for group in groups.values():
            present, following = following, self._begin(next(keys, None), pool)
            for number, place_mm in group:
                blocks[number] = pool.submit(restore, number, place_mm, present)
        del present, following
        try:
            for number in range(len(self._columns)):
                yield blocks.pop(number).result()
        finally:
            for block in blocks.values():
                block.cancel()

    def _groups(self, strip: "_Strip") -> dict["_Numbered | None", list[tuple[int, _Millimetres]]]:
        """Return the blocks of a row by what they share: a place, or none where they stay as is."""
        psf, y_px = self._psf, strip.span.centre
        groups: dict[_Numbered | None, list[tuple[int, _Millimetres]]] = {}
        for number, column in enumerate(self._columns):
            place_mm = psf.position_mm(column.centre, y_px)
            key = None
            if not strip.is_plain(column):
                key = psf.number_at(column.centre, y_px), self._shared(place_mm)
            groups.setdefault(key, []).append((number, place_mm))
        return groups

    def _shared(self, place_mm: _Millimetres) -> _Millimetres:
        """Return the place whose kernels serve a place."""
        kernels = self._psf.kernels
        if kernels.field_heights_mm.size == 1:
            return 0.0, 0.0
        # Only a round PSF has quadrants that mirror each other.
        return (abs(place_mm[0]), abs(place_mm[1])) if kernels.turns else place_mm

    def _begin(
        self, place: "_Numbered | None", pool: ThreadPoolExecutor
    ) -> "Future[_Place] | None":
        return None if place is None else pool.submit(self._place, place)

    def _place(self, place: "_Numbered") -> "_Place":
        """Return the OTF of a place, and what the filter knows of it."""
        number, place_mm = place
        otf = self._psf.otf_of(number, place_mm, self._block_px)
        # Kernels of one field are those of many heights.
        if self._knowledge is None or self._psf.kernels.field_heights_mm.size == 1:
            return _Place(otf=otf)
        return _Place(otf=otf, knowledge=self._knowledge(otf, float(np.hypot(*place_mm))))

    def _filtered(self, cut: "_Cut", place: "_Place", place_mm: _Millimetres) -> FloatArray:
        """Filter what was cut for a block, with the OTF of its place or of one that mirrors it."""
        samples, unknown, red = cut
        across, down = (self._psf.kernels.turns and along_mm < 0 for along_mm in place_mm)
        mirrored = np.s_[..., :: -1 if down else 1, :: -1 if across else 1]
        otf = place.otf
        if place.knowledge is None:
            otf, mirrored = mirror_otf(otf, flip_x=across, flip_y=down), np.s_[..., ::1, ::1]
        block = Block(
            samples=taper_edges(samples[mirrored], otf, self._guard_px),
            otf=otf,
            unknown=None if unknown is None else unknown[mirrored],
            height_mm=float(np.hypot(*place_mm)),
            knowledge=place.knowledge,
            red=red if red is None or place.knowledge is None else (red[0] ^ down, red[1] ^ across),
        )
        return self._filter(block)[mirrored]


def _lengthened(planes: FloatArray, rows: int) -> FloatArray:
    """Return the planes with zero rows added below, `rows` in all."""
    longer = np.zeros((planes.shape[0], rows, planes.shape[2]), dtype=np.float32)
    longer[:, : planes.shape[1]] = planes
    return longer


@dataclass(frozen=True, slots=True, kw_only=True)
class _Place:
    """The OTF of a place, and what the filter knows of it."""

    otf: ComplexArray
    knowledge: object = None


_Numbered = tuple[int, _Millimetres]
"""Number of the kernels of a place, and its position."""
_Cut = tuple[FloatArray, NDArray[np.bool_] | None, tuple[int, int] | None]
"""Samples of a block, which of them clipped, and where red lies in its first cell."""


@dataclass(frozen=True, slots=True)
class _Strip:
    """The rows of one block row, mirrored past the borders, their clipped samples, and red."""

    rows: FloatArray
    saturated: NDArray[np.bool_] | None
    span: Span
    plain: PlainBlock | None = None
    red: tuple[int, int] | None = None

    def is_plain(self, column: Span) -> bool:
        """Return whether a block stays as it is."""
        return self.plain is not None and self.plain(self.span, column)

    def cut(self, column: Span) -> _Cut:
        """Return samples, clipped samples and the place of red of one block."""
        samples = _select(self.rows, column.index, axis=2)
        # a border mirrored about its outermost samples goes on with the cells of the mosaic
        starts = self.span.start, column.start
        red = self.red
        if red is not None:
            red = (red[0] - starts[0]) % 2, (red[1] - starts[1]) % 2
        if self.saturated is None:
            return samples, None, red
        mask = self.saturated if self.saturated.ndim == 3 else self.saturated[None]
        unknown = _select(mask, column.index, axis=2)
        return samples, unknown if unknown.any() else None, red


def _select(planes: NDArray[Any], index: NDArray[np.intp], *, axis: int) -> NDArray[Any]:
    """Select some rows or columns: a view where they follow each other."""
    first, last = int(index[0]), int(index[-1])
    if last - first == index.size - 1 and (np.diff(index) == 1).all():
        return planes[(slice(None),) * axis + (slice(first, last + 1),)]
    return planes.take(index, axis=axis)
