"""Digital numbers to light, and the mask of what clipped; any row may be asked for."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from camkit.bundle.stages import Linearise
from camkit.runtime.capture import Capture
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.machine.memory import release_pages
from camkit.runtime.machine.slices import run_slices
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final[tuple[str, ...]] = ()
BYTES_PER_COLUMN: Final = 1_000
"""Of rows on their way (measured, see docs/guides/performance.md)."""
REST_SHARE: Final = 0.06


def prepare(entry: Linearise, job: Job) -> StageWork:
    """Prepare the scaling; nothing is decided here."""

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (capture,) = streams
        light = LinearRows(job)
        mask = MaskRows(job.capture)
        outputs = (
            _renamed(capture, light, "linear", "float32"),
            _renamed(capture, mask, "mask", "bool"),
        )
        return outputs[: len(entry.gives)]

    return StageWork(run=run, held_bytes=BYTES_PER_COLUMN * job.capture.width)


def _renamed(stream: Stream, source: "LinearRows | MaskRows", domain: str, type_: str) -> Stream:
    plane = stream.plane.model_copy(update={"domain": domain, "type": type_})
    return Stream(plane=plane, shape=source.shape, gains=stream.gains, source=source)


def seconds(_entry: Linearise, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels


class LinearRows:
    """The light of a capture, black 0 and white 1; a mosaic is one channel.

    Counts clipped samples, each row once.
    """

    def __init__(self, job: Job) -> None:
        self._job = job
        self._end = 0
        self._counted = 0
        self._clipped = 0

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w)."""
        shape: tuple[int, int, int] = self._job.capture.plane_shape
        return shape

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (channel, rows, w) float32, a new array."""
        capture = self._job.capture
        channels, _, width = self.shape
        light = np.empty((channels, bottom - top, width), dtype=np.float32)

        def fill(first: int, last: int) -> None:
            light[:, first:last] = capture.linear_rows(top + first, top + last)

        run_slices(fill, bottom - top, threads=self._job.threads)
        self._count(max(top, self._end), bottom)
        release_pages(capture.samples)
        return light

    def _count(self, top: int, bottom: int) -> None:
        if top >= bottom:
            return
        capture = self._job.capture
        self._end = bottom
        self._clipped += int(np.count_nonzero(capture.saturated_rows(top, bottom)))
        self._counted += (bottom - top) * capture.samples.size // capture.height
        self._job.log.clipped_fraction = self._clipped / self._counted


class MaskRows:
    """The clipped samples of a capture; a mosaic is one channel."""

    def __init__(self, capture: Capture) -> None:
        self._capture = capture

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w)."""
        return self._capture.plane_shape

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (channel, rows, w) bool, a new array."""
        mask = self._capture.saturated_rows(top, bottom)
        release_pages(self._capture.samples)
        return mask if mask.ndim == 3 else mask[None]
