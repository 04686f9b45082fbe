"""Dead and invalid samples replaced, and the mask of what stays unknown."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

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
"""Of rows on their way (measured, see docs/performance.md)."""
REST_SHARE: Final = 0.2

Places = tuple[NDArray[np.intp], ...]
"""Indices of samples as `np.nonzero` gives them: channel, row, column."""


def prepare(entry: Repair, job: Job) -> StageWork:
    """Make ready; nothing is decided here."""
    made: list[SoundRows] = []

    def run(taken: Sequence[Stream]) -> tuple[Stream, ...]:
        light, mask = taken[0], taken[1] if len(taken) > 1 else None
        sound = SoundRows(light.rows(), mosaic=job.capture.cfa is not None, threads=job.threads)
        made.append(sound)
        given = [light.with_source(sound)]
        if mask is not None:
            given.append(replace(mask, source=UnknownRows(mask.rows(), sound), made=None))
        return tuple(given[: len(entry.gives)])

    def warnings() -> tuple[str, ...]:
        # every product walks anew, over the same samples
        count = max((sound.repaired for sound in made), default=0)
        return (f"{count} dead or invalid pixels were repaired",) if count else ()

    return StageWork(run=run, held_bytes=BYTES_PER_COLUMN * job.capture.width, warnings=warnings)


def seconds(_entry: Repair, subject: Subject, _work: Work, speed: Speed) -> float:
    """Give the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels


class SoundRows:
    """Rows with broken samples replaced, equal to the whole in bits wherever reading begins.

    Attributes:
        repaired: Samples replaced in the rows read so far, each row counted once.
    """

    def __init__(self, source: RowSource, *, mosaic: bool, threads: int) -> None:
        self._source = source
        self._mosaic = mosaic
        self._threads = threads
        self._span = (0, 0)
        self._mended: list[Places] = []
        self.repaired = 0

    @property
    def shape(self) -> tuple[int, int, int]:
        """Give (channel, h, w)."""
        return self._source.shape

    def read(self, top: int, bottom: int) -> Rows:
        """Give rows top..bottom as (channel, rows, w) float32, a new array."""
        sound, mended = self._mend(top, bottom)
        begin, end = self._span
        if begin == end:
            self._span = (top, top)
            end = top
        if top <= end < bottom:
            new = mended[1] >= end
            self._mended.append(tuple(index[new] for index in mended))
            self.repaired += int(np.count_nonzero(new))
            self._span = (self._span[0], bottom)
        return sound

    def places(self, top: int, bottom: int) -> Places:
        """Give which samples of rows top..bottom were replaced."""
        if not self._span[0] <= top <= bottom <= self._span[1]:
            return self._mend(top, bottom)[1]
        known = self._mended or [(np.zeros(0, np.intp),) * 3]
        found = tuple(np.concatenate(parts) for parts in zip(*known, strict=True))
        inside = (found[1] >= top) & (found[1] < bottom)
        return tuple(index[inside] for index in found)

    def _mend(self, top: int, bottom: int) -> tuple[Rows, Places]:
        margin, (channels, height, width) = REPAIR_MARGIN_PX, self.shape
        above, below = max(top - margin, 0), min(bottom + margin, height)
        light = self._source.read(above, below)
        sound = np.empty((channels, bottom - top, width), dtype=np.float32)
        found: dict[int, Places] = {}

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
            found[first] = channel, row + top + first, column

        run_slices(fill, bottom - top, threads=self._threads)
        ordered = [found[first] for first in sorted(found)]
        places = tuple(np.concatenate(parts) for parts in zip(*ordered, strict=True))
        return sound, places


class UnknownRows:
    """A mask without the samples that were replaced: their light is known from their neighbours."""

    def __init__(self, mask: RowSource, sound: SoundRows) -> None:
        self._mask = mask
        self._sound = sound

    @property
    def shape(self) -> tuple[int, int, int]:
        """Give (channel, h, w)."""
        return self._mask.shape

    def read(self, top: int, bottom: int) -> Rows:
        """Give rows top..bottom as (channel, rows, w) bool, a new array."""
        unknown = self._mask.read(top, bottom).copy()
        channel, row, column = self._sound.places(top, bottom)
        unknown[channel, row - top, column] = False
        return unknown
