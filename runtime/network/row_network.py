"""A network over a picture in strips of whole rows, segment by segment: nothing computed twice.

    source rows -> segment 0 -> rows held -> segment 1 -> rows held -> ... -> rows of the result

                 done            done + strip
    segment k   ===|================|            what it has given, what it gives next
    its input   ===|================|--reach--|  what the segments before must have given by then

Every tensor that crosses a cut is held for as many rows as its readers still need. Strips begin
and end on the lattice of a segment and zeros lie beyond the picture's border only, so the bits are
those of a run on the whole picture.
"""

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
        needed_bytes: Memory of a run: rows held between segments, and the largest strip.
        work_ratio: Computed over necessary multiplications.
    """

    height_px: int
    width_px: int
    strip_px: int
    stops: tuple[tuple[int, ...], ...]
    needed_bytes: int
    work_ratio: float

    @property
    def area_px(self) -> int:
        """Return the pixels of the padded picture."""
        return self.height_px * self.width_px


def plan_strips(segments: Sequence[Segment], size_px: tuple[int, int], strip_px: int) -> StripPlan:
    """Plan the strips of a picture.

    Args:
        segments: Of the network.
        size_px: (height, width) after padding to the network's stride.
        strip_px: Rows at a time.
    """
    height, width = size_px
    readers = _readers(segments)
    stops = []
    for bottom in [*range(strip_px, height, strip_px), height]:
        ends = [0] * len(segments)
        for k in range(len(segments) - 1, -1, -1):
            bottoms = [ends[i] + segments[i].reach_px for i in readers[k]] or [bottom]
            lattice = segments[k].lattice_px
            ends[k] = min(-(-max(bottoms) // lattice) * lattice, height)
        stops.append(tuple(ends))
    return StripPlan(
        height_px=height,
        width_px=width,
        strip_px=strip_px,
        stops=tuple(stops),
        needed_bytes=_needed_bytes(segments, stops, size_px),
        work_ratio=_work_ratio(segments, stops, height),
    )


def _readers(segments: Sequence[Segment]) -> list[list[int]]:
    """Return the segments that read the outputs of each."""
    return [
        [
            i
            for i, other in enumerate(segments)
            if {feed.port.name for feed in other.feeds} & {port.name for port in one.outputs}
        ]
        for one in segments
    ]


def _needed_bytes(
    segments: Sequence[Segment], stops: Sequence[Sequence[int]], size_px: tuple[int, int]
) -> int:
    """Return the peak of what is held and of the largest strip; after a while all are alike."""
    (height, width), readers, peak = size_px, _readers(segments), 0.0
    for done, ends in pairwise(([0] * len(segments), *stops[:_SEEN_STRIPS])):
        tops = [max(d - s.reach_px, 0) for d, s in zip(done, segments, strict=True)]
        waiting = sum(
            (ends[k] - min((tops[i] for i in readers[k]), default=done[k])) * one.held_bytes
            for k, one in enumerate(segments)
        )
        strip = max(
            (min(end + one.reach_px, height) - top) * one.strip_bytes
            for end, one, top in zip(ends, segments, tops, strict=True)
        )
        peak = max(peak, width * (waiting + strip))
    return int(peak)


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


_SEEN_STRIPS: Final = 64


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

    def fed(self, feed: Feed, top: int, bottom: int) -> FloatArray:
        """Return rows as a segment takes them, (1, c, b rows, b w), contiguous."""
        parts = list(self._parts(top, bottom))
        if feed.block > 1:
            width, block = parts[0][1].shape[2], feed.block
            fine = np.empty((1, feed.channels, block * (bottom - top), block * width), np.float32)
            for first, rows in parts:
                at = slice(block * (first - top), block * (first - top + rows.shape[1]))
                _shuffle(rows, feed, fine[0][:, at])
            return fine
        channels = self.port.channels  # what lies below them in the picture is no input
        if len(parts) == 1 and parts[0][1].flags.c_contiguous:
            return parts[0][1][None, :channels]
        return np.concatenate([rows[:channels] for _, rows in parts], axis=1)[None]

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
        segment = self._segments[k]
        top = max(start - segment.reach_px, 0)
        bottom = min(stop + segment.reach_px, self._plan.height_px)
        inputs = [
            self._tensors[feed.port.name].fed(
                feed, feed.port.samples(top), feed.port.samples(bottom)
            )
            for feed in segment.feeds
        ]
        outputs = self._engines[k].run(inputs)
        for port, output in zip(segment.outputs, outputs, strict=True):
            rows = output[0][:, port.samples(start - top) : port.samples(stop - top)]
            self._tensors[port.name].pieces.append((port.samples(start), rows))

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
