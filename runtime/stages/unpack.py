"""Pictures made of whole cells of a mosaic, cut to the samples of the capture."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from camkit.bundle.sensor import MOSAIC
from camkit.bundle.stages import Unpack
from camkit.bundle.stages.foreign.pack import CELL_PX, PLACES
from camkit.errors import ContractError
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows, RowSource
from camkit.runtime.stages.pack import cell_start

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final[tuple[str, ...]] = ()
ON_MOSAIC: Final = True
BYTES_PER_COLUMN: Final = 2_000
"""Of rows on their way."""
REST_SHARE: Final = 0.03


def prepare(entry: Unpack, job: Job) -> StageWork:
    """Make ready; nothing is decided here.

    Raises:
        ContractError: If the capture is no mosaic.
    """
    capture, plane = job.capture, job.known_bundle.manifest.planes[entry.gives[0]]
    if capture.cfa is None:
        raise ContractError("cells of a mosaic are unpacked, and this capture is planes")
    down, right = cell_start(capture.cfa)

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (cells,) = streams
        source: RowSource = cells.rows()
        if plane.channels == MOSAIC:
            source = WovenRows(source, cells.plane.channels)
        fine = round(1 / plane.grid.pitch_ratio)
        rows = CutRows(source, (fine * down, fine * right), job.grid_px(plane))
        return (Stream(plane=plane, shape=rows.shape, gains=cells.gains, source=rows),)

    return StageWork(run=run, held_bytes=BYTES_PER_COLUMN * job.capture.width)


def seconds(_entry: Unpack, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels


class CutRows:
    """A part of a picture."""

    def __init__(
        self, source: RowSource, corner: tuple[int, int], size_px: tuple[int, int]
    ) -> None:
        self._source = source
        self._corner, self._size_px = corner, size_px

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w)."""
        return self._source.shape[0], *self._size_px

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (channel, rows, w), a new array."""
        down, right = self._corner
        rows = self._source.read(top + down, bottom + down)
        return rows[:, :, right : right + self._size_px[1]].copy()


class WovenRows:
    """The mosaic of four planes of half its size."""

    def __init__(self, source: RowSource, order: Sequence[str]) -> None:
        self._source = source
        self._channels = {place: order.index(colour) for colour, place in PLACES.items()}

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (1, h, w)."""
        _, height, width = self._source.shape
        return 1, CELL_PX * height, CELL_PX * width

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (1, rows, w) float32, a new array."""
        first, last = top // CELL_PX, -(-bottom // CELL_PX)
        cells = self._source.read(first, last)
        mosaic = np.empty((CELL_PX * (last - first), self.shape[2]), np.float32)
        for (y, x), channel in self._channels.items():
            mosaic[y::CELL_PX, x::CELL_PX] = cells[channel]
        return mosaic[None, top - CELL_PX * first : bottom - CELL_PX * first]
