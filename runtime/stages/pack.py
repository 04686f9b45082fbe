"""A mosaic packed: planes of half its size, whose cells begin with red."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from camkit.bundle.stages import Pack
from camkit.bundle.stages.foreign.pack import CELL_PX, PLACES, CodedColour
from camkit.cfa import CfaPattern
from camkit.errors import ContractError
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.rows import Rows, RowSource

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final[tuple[str, ...]] = ()
ON_MOSAIC: Final = True
BYTES_PER_COLUMN: Final = 1_000
"""Of rows on their way."""
REST_SHARE: Final = 0.04
_MIRRORED_ROWS: Final = 3


def prepare(entry: Pack, job: Job) -> StageWork:
    """Make ready; nothing is decided here.

    Raises:
        ContractError: If the capture is no mosaic.
    """
    cfa = job.capture.cfa
    if cfa is None:
        raise ContractError(
            "the network of this camera takes the samples of a mosaic, and this capture is planes"
        )

    def run(streams: Sequence[Stream]) -> tuple[Stream, ...]:
        (mosaic,) = streams
        rows = PackedRows(mosaic.rows(), cfa, entry.order)
        plane = job.known_bundle.manifest.planes[entry.gives[0]]
        return (Stream(plane=plane, shape=rows.shape, gains=mosaic.gains, source=rows),)

    return StageWork(run=run, held_bytes=BYTES_PER_COLUMN * job.capture.width)


def seconds(_entry: Pack, subject: Subject, _work: Work, speed: Speed) -> float:
    """Return the seconds that it will take."""
    return REST_SHARE * speed.rest_s_per_mp * subject.megapixels


def cell_start(cfa: CfaPattern) -> tuple[int, int]:
    """Return the rows and columns that come before a capture, so that its cells begin with red."""
    row, column = divmod(cfa.index("R"), CELL_PX)
    return row, column


class PackedRows:
    """Rows of four planes of a mosaic, equal to the whole in bits wherever reading begins."""

    def __init__(self, source: RowSource, cfa: CfaPattern, order: Sequence[CodedColour]) -> None:
        self._source = source
        self._start = cell_start(cfa)
        self._places = [PLACES[colour] for colour in order]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (4, h, w)."""
        _, height, width = self._source.shape
        return len(self._places), height // CELL_PX + 1, width // CELL_PX + 1

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom as (4, rows, w) float32, a new array."""
        _, height, width = self._source.shape
        down, right = self._start
        rows = mirrored(np.arange(CELL_PX * top, CELL_PX * bottom) - down, height)
        # rows are read downwards: the last ones are mirrored to some that lie above
        first, last = max(CELL_PX * top - down - _MIRRORED_ROWS, 0), int(rows.max()) + 1
        mosaic = self._source.read(first, last)[0][rows - first]
        columns = mirrored(np.arange(CELL_PX * self.shape[2]) - right, width)
        wide = mosaic[:, columns]
        return np.stack([wide[y::CELL_PX, x::CELL_PX] for y, x in self._places])


def mirrored(places: np.ndarray, size: int) -> np.ndarray:
    """Return places on an axis, those outside mirrored about the border sample."""
    inside = np.abs(places)
    back = np.where(inside >= size, 2 * (size - 1) - inside, inside)
    return np.asarray(np.clip(back, 0, size - 1))
