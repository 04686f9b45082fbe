"""A network over a picture in strips of whole rows, segment by segment: nothing computed twice.

    source rows -> segment 0 -> rows held -> segment 1 -> rows held -> ... -> rows of the result

                 done            done + strip
    segment k   ===|================|            what it has given, what it gives next
    its input   ===|================|--reach--|  what the segments before must have given by then

Every tensor that crosses a cut is held for as many rows as its readers still need. Strips begin
and end on the lattice of a segment and zeros lie beyond the picture's border only, so the bits are
those of a run on the whole picture.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import cv2
import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.cancel import Cancel, check_cancelled
from camkit.runtime.network.engine import SegmentEngine
from camkit.runtime.network.segment import Feed, Port, Segment
from camkit.runtime.network.tiling import TileLayout
from camkit.runtime.rows import RowSource


@dataclass(frozen=True, slots=True, kw_only=True)
class StripPlan:
    """Strips of a picture.

    Attributes:
        height_px: Rows of the padded picture.
        width_px: Columns of the padded picture.
        strip_px: Rows of the result at a time, a multiple of the network's stride.
        stops: (strip, segment) rows that a segment has given when a strip is done.
        columns: Width of the parts that each segment's strips are run in.
        needed_bytes: Memory of a run: rows held between segments, and the largest part.
        work_ratio: Computed over necessary multiplications.
    """

    height_px: int
    width_px: int
    strip_px: int
    stops: tuple[tuple[int, ...], ...]
    columns: tuple[int, ...]
    needed_bytes: int
    work_ratio: float

    @property
    def area_px(self) -> int:
        """Return the pixels of the padded picture."""
        return self.height_px * self.width_px


def plan_strips(
    segments: Sequence[Segment],
    size_px: tuple[int, int],
    strip_px: int,
    channels: int | None = None,
) -> StripPlan:
    """Plan the strips of a picture.

    Args:
        segments: Of the network.
        size_px: (height, width) after padding to the network's stride.
        strip_px: Rows at a time.
        channels: Of the picture, those that the network does not take included; None for its own.
    """
    height, width = size_px
    readers = [
        [
            i
            for i, other in enumerate(segments)
            if {feed.port.name for feed in other.feeds} & {port.name for port in one.outputs}
        ]
        for one in segments
    ]
    stops = []
    for bottom in [*range(strip_px, height, strip_px), height]:
        ends = [0] * len(segments)
        for k in range(len(segments) - 1, -1, -1):
            bottoms = [ends[i] + segments[i].reach_px for i in readers[k]] or [bottom]
            lattice = segments[k].lattice_px
            ends[k] = min(-(-max(bottoms) // lattice) * lattice, height)
        stops.append(tuple(ends))
    columns = tuple(_columns(one, strip_px, width) for one in segments)
    waiting = _waiting_samples(segments, stops, channels or segments[0].feeds[0].port.channels)
    part = max(
        one.strip_bytes * (strip_px + 2 * one.reach_px) * min(part + 2 * one.reach_px, width)
        for part, one in zip(columns, segments, strict=True)
    )
    return StripPlan(
        height_px=height,
        width_px=width,
        strip_px=strip_px,
        stops=tuple(stops),
        columns=columns,
        needed_bytes=int(_FLOAT_BYTES * width * waiting + part),
        work_ratio=_work_ratio(segments, stops, height),
    )


def _columns(segment: Segment, strip_px: int, width_px: int) -> int:
    """Return the width of the parts in which a segment's strips are run."""
    height = strip_px + 2 * segment.reach_px
    parts = math.ceil(segment.strip_bytes * height * width_px / PART_BYTES)
    lattice = segment.lattice_px
    return max(-(-width_px // (parts * lattice)) * lattice, 4 * segment.reach_px, lattice)


def _waiting_samples(
    segments: Sequence[Segment], stops: Sequence[Sequence[int]], channels: int
) -> float:
    """Return the most samples that wait for their readers, per pixel of width.

    From some strip on all need the same.
    """
    tensors = {port.name: port for one in segments for port in one.outputs}
    source = segments[0].feeds[0].port
    readers = {
        name: [k for k, s in enumerate(segments) if any(f.port.name == name for f in s.feeds)]
        for name in (*tensors, source.name)
    }
    makers = {port.name: k for k, one in enumerate(segments) for port in one.outputs}
    most = 0.0
    for done, ends in pairwise(([0] * len(segments), *stops[:_SEEN_STRIPS])):
        tops = [max(d - s.reach_px, 0) for d, s in zip(done, segments, strict=True)]
        bottom = max(ends[k] + segments[k].reach_px for k in readers[source.name])
        samples: float = channels * (
            bottom - min([tops[k] for k in readers[source.name]] + [done[-1]])
        )
        for name, port in tensors.items():
            top = min((tops[k] for k in readers[name]), default=done[makers[name]])
            samples += (ends[makers[name]] - top) * port.channels / float(port.step) ** 2
        most = max(most, samples)
    return most


def _work_ratio(
    segments: Sequence[Segment], stops: Sequence[Sequence[int]], height_px: int
) -> float:
    """Return computed over necessary multiplications."""
    work = 0.0
    for done, ends in pairwise(([0] * len(segments), *stops)):
        for start, end, one in zip(done, ends, segments, strict=True):
            if end > start:
                top, bottom = max(start - one.reach_px, 0), min(end + one.reach_px, height_px)
                work += (bottom - top) * one.mac_per_pixel
    return work / max(height_px * sum(one.mac_per_pixel for one in segments), 1)


_FLOAT_BYTES: Final = 4
_SEEN_STRIPS: Final = 64
PART_BYTES: Final = 64e6
"""Memory of a part of a strip: as little as lets few pixels be computed twice."""


@dataclass(frozen=True, slots=True)
class _Reach:
    """The pixels that a segment gives along one axis, and those that it looks at.

    Attributes:
        start: First pixel that it gives.
        stop: One past the last.
        reach_px: Beyond these.
        size_px: Of the picture.
    """

    start: int
    stop: int
    reach_px: int
    size_px: int

    @property
    def low(self) -> int:
        """Return the first pixel that it looks at."""
        return max(self.start - self.reach_px, 0)

    @property
    def high(self) -> int:
        """Return one past the last."""
        return min(self.stop + self.reach_px, self.size_px)

    def inner(self, port: Port) -> slice:
        """Return where the samples that it gives lie in its output."""
        return slice(port.samples(self.start - self.low), port.samples(self.stop - self.low))


@dataclass(slots=True)
class _Tensor:
    """The rows of one tensor that somebody still needs.

    Attributes:
        port: The tensor.
        pieces: (first row, rows (c, r, w)) in order.
    """

    port: Port
    pieces: deque[tuple[int, FloatArray]] = field(default_factory=deque)

    def fill(self, rows: FloatArray, top: int) -> None:
        """Copy rows from `top` on to (c, rows, w)."""
        parts = self._parts(top, top + rows.shape[1])
        np.concatenate([part for _, part in parts], axis=1, out=rows)

    def fed(self, feed: Feed, rows: "_Reach", columns: "_Reach") -> FloatArray:
        """Return a part as a segment takes it, (1, c, b rows, b columns), contiguous."""
        port, block = self.port, feed.block
        top, bottom = port.samples(rows.low), port.samples(rows.high)
        left, right = port.samples(columns.low), port.samples(columns.high)
        parts = [(first, piece[:, :, left:right]) for first, piece in self._parts(top, bottom)]
        if block > 1:
            size = block * (bottom - top), block * (right - left)
            fine = np.empty((1, feed.channels, *size), np.float32)
            for first, piece in parts:
                at = slice(block * (first - top), block * (first - top + piece.shape[1]))
                _shuffle(piece, feed, fine[0][:, at])
            return fine
        channels = port.channels  # what lies below them in the picture is no input
        if len(parts) == 1 and parts[0][1].flags.c_contiguous:
            return parts[0][1][None, :channels]
        return np.concatenate([piece[:channels] for _, piece in parts], axis=1)[None]

    def forget(self, top: int) -> None:
        """Forget what lies above a row."""
        while self.pieces and self.pieces[0][0] + self.pieces[0][1].shape[1] <= top:
            self.pieces.popleft()

    def _parts(self, top: int, bottom: int) -> Iterator[tuple[int, FloatArray]]:
        """Yield (first row, rows) of all pieces that hold some of these rows."""
        for first, rows in self.pieces:
            if first < bottom and first + rows.shape[1] > top:
                yield max(first, top), rows[:, max(top - first, 0) : bottom - first]


def _shuffle(rows: FloatArray, feed: Feed, fine: FloatArray) -> None:
    """Move the channels of a tensor (c b^2, r, w) to the pixels of blocks, (c, b r, b w)."""
    block, channels = feed.block, feed.channels
    height, width = rows.shape[1:]
    places = fine.reshape(channels, height, block, width, block)
    for channel in range(channels):
        for i in range(block):
            numbers = (
                [(i * block + j) * channels + channel for j in range(block)]
                if feed.depth_first
                else [(channel * block + i) * block + j for j in range(block)]
            )
            cv2.merge([rows[n] for n in numbers], dst=places[channel, :, i])


class NetworkRows:
    """The result of a network on a padded picture, as rows that are computed when asked for."""

    def __init__(
        self,
        engines: Sequence[SegmentEngine],
        source: RowSource,
        plan: StripPlan,
        cancel: Cancel | None = None,
        trim: Callable[[], None] = lambda: None,
    ) -> None:
        """Store what is run.

        Args:
            engines: The segments of the network.
            source: (c, h, w) picture, its first channels the input of the network; each of its
                rows is read once.
            plan: For the padded size of the source.
            cancel: Asked before every run of a segment.
            trim: Called before every strip.
        """
        self._engines, self._plan, self._cancel, self._trim = engines, plan, cancel, trim
        self._segments = segments = [engine.segment for engine in engines]
        self._padded = _Padded(source, plan.height_px, plan.width_px)
        feeds = [feed.port for segment in segments for feed in segment.feeds]
        ports = {p.name: p for p in (*feeds, *(p for s in segments for p in s.outputs))}
        self._tensors = {name: _Tensor(port) for name, port in ports.items()}
        self._input = self._tensors[segments[0].feeds[0].port.name]
        self._result = self._tensors[segments[-1].outputs[0].name]
        self._done = [0] * len(segments)
        self._strips = iter(plan.stops)
        self._top = 0

    def fill_inputs(self, rows: FloatArray, top: int) -> None:
        """Copy the padded picture from row `top` on to (c, rows, w); never above an earlier one."""
        self._top = top
        self._forget()
        self._read_to(top + rows.shape[1])
        self._input.fill(rows, top)

    def fill_result(self, rows: FloatArray, top: int) -> None:
        """Copy the result from row `top` of the picture on to (k, s rows, s w)."""
        port = self._result.port
        first = port.samples(top)
        while port.samples(self._done[-1]) < first + rows.shape[1]:
            self._step(next(self._strips))
        self._result.fill(rows, first)

    def _step(self, stops: Sequence[int]) -> None:
        """Compute a strip."""
        self._trim()
        segments = self._segments
        pairs = [
            (stop, s)
            for stop, s in zip(stops, segments, strict=True)
            if any(feed.port == self._input.port for feed in s.feeds)
        ]
        self._read_to(min(max(stop + s.reach_px for stop, s in pairs), self._plan.height_px))
        for k, stop in enumerate(stops):
            if stop > self._done[k]:
                self._run(k, self._done[k], stop)
                self._done[k] = stop
        self._forget()

    def _read_to(self, bottom: int) -> None:
        if bottom > self._padded.end:
            self._input.pieces.append((self._padded.end, self._padded.read_to(bottom)))

    def _run(self, k: int, start: int, stop: int) -> None:
        check_cancelled(self._cancel)
        segment, width, part_px = self._segments[k], self._plan.width_px, self._plan.columns[k]
        rows = _Reach(start, stop, segment.reach_px, self._plan.height_px)
        parts = [
            _Reach(left, min(left + part_px, width), segment.reach_px, width)
            for left in range(0, width, part_px)
        ]
        whole = [
            np.empty((port.channels, port.samples(stop - start), port.samples(width)), np.float32)
            for port in segment.outputs
            if len(parts) > 1
        ]
        for columns in parts:
            inputs = [
                self._tensors[feed.port.name].fed(feed, rows, columns) for feed in segment.feeds
            ]
            outputs = self._engines[k].run(inputs)
            crops = [
                output[0][:, rows.inner(port), columns.inner(port)]
                for port, output in zip(segment.outputs, outputs, strict=True)
            ]
            del inputs, outputs
            for port, part, all_columns in zip(segment.outputs, crops, whole, strict=False):
                all_columns[:, :, port.samples(columns.start) : port.samples(columns.stop)] = part
        for port, piece in zip(segment.outputs, whole or crops, strict=True):
            self._tensors[port.name].pieces.append((port.samples(start), piece))

    def _forget(self) -> None:
        """Forget rows that nobody needs any more."""
        for tensor in self._tensors.values():
            tops = [
                stop - segment.reach_px
                for segment, stop in zip(self._segments, self._done, strict=True)
                if any(feed.port == tensor.port for feed in segment.feeds)
            ]
            if tensor is self._input or tensor is self._result:
                tops.append(self._top)
            tensor.forget(tensor.port.samples(max(min(tops), 0)))


class StripWindows:
    """Windows of whole rows of a network's input and of its result, in two buffers."""

    def __init__(self, rows: NetworkRows, layout: TileLayout, shape: tuple[int, int, int]) -> None:
        """Allocate the buffers.

        Args:
            rows: Of the network.
            layout: Windows of whole rows.
            shape: Channels of the picture, channels of the result and its samples per pixel.
        """
        self._rows, self._top = rows, 0
        channels, outputs, scale = shape
        height, width = layout.window_height_px, layout.window_width_px
        self._inputs = np.empty((channels, height, width), np.float32)
        self._result = np.empty((1, outputs, scale * height, scale * width), np.float32)

    def move_to(self, top: int) -> FloatArray:
        """Return the input from `top` on, (c, rows, padded w); never above an earlier `top`."""
        self._top = top
        self._rows.fill_inputs(self._inputs, top)
        return self._inputs

    def result(self, _: FloatArray) -> FloatArray:
        """Return the result of the same rows, (1, k, s rows, s w)."""
        self._rows.fill_result(self._result[0], self._top)
        return self._result


class _Padded:
    """A source with its far sides continued by their edges, read downwards once."""

    def __init__(self, source: RowSource, height: int, width: int) -> None:
        _, rows, columns = source.shape
        if height < rows or width < columns:
            raise ContractError(f"{height}x{width} does not hold a picture {source.shape}")
        self._source, self._height, self._width = source, height, width
        self._edge: FloatArray | None = None
        self.end = 0

    def read_to(self, bottom: int) -> FloatArray:
        """Return the rows from the last one read up to `bottom`."""
        channels, height, width = self._source.shape
        rows = np.empty((channels, bottom - self.end, self._width), np.float32)
        inside = min(bottom, height) - self.end
        if inside > 0:
            rows[:, :inside, :width] = self._source.read(self.end, self.end + inside)
            rows[:, :inside, width:] = rows[:, :inside, width - 1 : width]
            self._edge = rows[:, inside - 1 : inside].copy()
        if bottom > height and self._edge is not None:
            rows[:, max(inside, 0) :] = self._edge
        self.end = bottom
        return rows
