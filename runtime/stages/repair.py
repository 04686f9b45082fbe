"""Dead and invalid samples replaced, and the mask of what stays unknown."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages import Repair
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.machine.slices import run_slices
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows, RowSource
from camkit.runtime.signal.noise import (
    REPAIR_MARGIN_PX,
    places_of,
    repair_mosaic,
    repair_planes,
)

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final[tuple[str, ...]] = ()
BYTES_PER_COLUMN: Final = 1_000
"""Of rows on their way (measured, see docs/guides/performance.md)."""
REST_SHARE: Final = 0.2

MOST_KEPT: Final = 2**18
"""Samples whose place and value are kept for whoever reads them again: 7 MB."""
Places = tuple[NDArray[np.intp], ...]
"""Indices of samples as `np.nonzero` gives them: channel, row, column."""


def prepare(entry: Repair, job: Job) -> StageWork:
    """Prepare the repair; nothing is decided here."""
    repairs: list[SoundRows] = []
    mended = job.cache.setdefault(("repair", entry.takes), Mended())

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        light, mask = streams[0], streams[1] if len(streams) > 1 else None
        mosaic = job.capture.cfa is not None
        sound = SoundRows(light.rows(), mosaic=mosaic, threads=job.threads, mended=mended)
        repairs.append(sound)
        outputs = [light.with_source(sound)]
        if mask is not None:
            outputs.append(
                replace(mask, source=UnknownRows(mask.rows(), sound), band_iterator=None)
            )
        return tuple(outputs[: len(entry.gives)])

    def warnings() -> tuple[str, ...]:
        # every product walks anew, over the same samples
        count = max((sound.repaired for sound in repairs), default=0)
        return (f"{count} dead or invalid pixels were repaired",) if count else ()

    return StageWork(run=run, held_bytes=BYTES_PER_COLUMN * job.capture.width, warnings=warnings)


def seconds(_entry: Repair, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels


class Mended:
    """The samples that were replaced in rows without a gap, for whoever reads these rows again."""

    def __init__(self) -> None:
        self._span = (0, 0)
        self._places: list[Places] = []
        self._values: list[FloatArray] = []
        self._count = 0

    def hold(self, top: int, bottom: int) -> bool:
        """Return whether rows top..bottom were looked at."""
        return self._span[0] <= top <= bottom <= self._span[1] and bottom > self._span[0]

    def add(self, top: int, bottom: int, places: Places, values: FloatArray) -> None:
        """Record the replaced samples of rows top..bottom; more than `MOST_KEPT` are not kept."""
        begin, end = self._span
        if begin == end:
            begin = end = top
        if not top <= end < bottom or self._count > MOST_KEPT:
            return
        new = places[1] >= end
        self._places.append(tuple(index[new] for index in places))
        self._values.append(values[new])
        self._span = begin, bottom
        self._count += int(np.count_nonzero(new))
        if self._count > MOST_KEPT:
            self._span, self._places, self._values = (0, 0), [], []

    def of_rows(self, top: int, bottom: int) -> tuple[Places, FloatArray]:
        """Return places and values in rows top..bottom, which it must hold."""
        if len(self._places) > 1:
            self._places = [_joined(self._places)]
            self._values = [np.concatenate(self._values)]
        places, values = self._places[0], self._values[0]
        inside = (places[1] >= top) & (places[1] < bottom)
        return tuple(index[inside] for index in places), values[inside]


class SoundRows:
    """Rows with broken samples replaced, equal to the whole in bits wherever reading begins.

    What another walk over the same capture has replaced is not sought again.

    Attributes:
        repaired: Samples replaced in the rows read so far, each row counted once.
    """

    def __init__(
        self, source: RowSource, *, mosaic: bool, threads: int, mended: Mended | None = None
    ) -> None:
        self._source = source
        self._mosaic = mosaic
        self._threads = threads
        self._mended = Mended() if mended is None else mended
        self._end = 0
        self.repaired = 0

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w)."""
        return self._source.shape

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (channel, rows, w) float32, a new array."""
        sound, places = self._mend(top, bottom)
        self.repaired += int(np.count_nonzero(places[1] >= self._end))
        self._end = max(self._end, bottom)
        return sound

    def places(self, top: int, bottom: int) -> Places:
        """Return the replaced samples of rows top..bottom."""
        if self._mended.hold(top, bottom):
            return self._mended.of_rows(top, bottom)[0]
        return self._mend(top, bottom)[1]

    def _mend(self, top: int, bottom: int) -> tuple[Rows, Places]:
        margin, height = REPAIR_MARGIN_PX, self.shape[1]
        above, below = max(top - margin, 0), min(bottom + margin, height)
        light = self._source.read(above, below)
        if self._mended.hold(top, bottom):
            sound = light[:, top - above : bottom - above].copy()
            places, values = self._mended.of_rows(top, bottom)
            sound[places[0], places[1] - top, places[2]] = values
            return sound, places
        sound, places = self._search(light, above, top, bottom)
        self._mended.add(top, bottom, places, sound[places[0], places[1] - top, places[2]])
        return sound, places

    def _search(self, light: Rows, above: int, top: int, bottom: int) -> tuple[Rows, Places]:
        """Replace what is broken in rows top..bottom of light, whose first row is `above`."""
        margin, (channels, height, width) = REPAIR_MARGIN_PX, self.shape
        sound = np.empty((channels, bottom - top, width), dtype=np.float32)
        broken_places: dict[int, Places] = {}

        def fill(first: int, last: int) -> None:
            begin = max(top + first - margin, 0) - above
            end = min(top + last + margin, height) - above
            part = light[:, begin:end]
            inside = slice(top + first - above - begin, top + last - above - begin)
            if self._mosaic:
                plane, broken = repair_mosaic(part[0])
                part, mask = plane[None], broken[None]
            else:
                part, mask = repair_planes(part)
            sound[:, first:last] = part[:, inside]
            channel, row, column = places_of(mask[:, inside])
            broken_places[first] = channel, row + top + first, column

        run_slices(fill, bottom - top, threads=self._threads)
        ordered = [broken_places[first] for first in sorted(broken_places)]
        return sound, _joined(ordered)


def _joined(places: Sequence[Places]) -> Places:
    return tuple(np.concatenate(parts) for parts in zip(*places, strict=True))


class UnknownRows:
    """A mask without the samples that were replaced: their light is known from their neighbours."""

    def __init__(self, mask: RowSource, sound: SoundRows) -> None:
        self._mask = mask
        self._sound = sound

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w)."""
        return self._mask.shape

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (channel, rows, w) bool, a new array."""
        unknown = self._mask.read(top, bottom).copy()
        channel, row, column = self._sound.places(top, bottom)
        unknown[channel, row - top, column] = False
        return unknown
