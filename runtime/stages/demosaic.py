"""A mosaic made three planes; planes that come as such pass through."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from camkit.bundle.sensor import MOSAIC, RGB
from camkit.bundle.stages import Demosaic
from camkit.cfa import CfaPattern
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.machine.slices import run_slices
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows, RowSource
from camkit.runtime.signal.demosaic import (
    DEMOSAIC_MARGIN_PX,
    DemosaicMethod,
    demosaic_part,
    shift_rows,
)

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final = ("demosaic", "scale")
BYTES_PER_COLUMN: Final = 2_000
"""Of rows on their way (measured, see docs/guides/performance.md)."""
REST_SHARE: Final = 0.15


def prepare(entry: Demosaic, job: Job) -> StageWork:
    """Choose the method: the caller's, else the bundle's."""
    method = job.options.demosaic or entry.method
    cfa = job.capture.cfa

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (mosaic,) = streams
        if mosaic.plane.channels != MOSAIC or cfa is None:
            return (mosaic,)
        rows = ColorRows(mosaic.rows(), cfa, method, threads=job.threads)
        plane = mosaic.plane.model_copy(update={"channels": RGB})
        return (Stream(plane=plane, shape=rows.shape, gains=mosaic.gains, source=rows),)

    return StageWork(run=run, held_bytes=BYTES_PER_COLUMN * job.capture.width)


def seconds(_entry: Demosaic, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels


class ColorRows:
    """Three planes of a mosaic, equal to the whole in bits wherever reading begins."""

    def __init__(
        self, source: RowSource, cfa: CfaPattern, method: DemosaicMethod, *, threads: int
    ) -> None:
        self._source = source
        self._cfa = cfa
        self._method = method
        self._threads = threads

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (3, h, w)."""
        _, height, width = self._source.shape
        return 3, height, width

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (3, rows, w) float32, a new array."""
        margin, (_, height, width) = DEMOSAIC_MARGIN_PX[self._method], self.shape
        above, below = max(top - margin, 0), min(bottom + margin, height)
        mosaic = self._source.read(above, below)[0]
        cfa = shift_rows(self._cfa, above)
        planes = np.empty((3, bottom - top, width), dtype=np.float32)

        def fill(first: int, last: int) -> None:
            rows = top - above + first, top - above + last
            box = rows[0], 0, rows[1], width
            planes[:, first:last] = demosaic_part(mosaic, cfa, self._method, box)

        run_slices(fill, bottom - top, threads=self._threads)
        return planes
