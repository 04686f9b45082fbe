"""Progress of a capture: the rows that every stage has given, together; and cancellation."""

from collections.abc import Iterator, Sequence
from typing import Final

from camkit.runtime.cancel import Cancel, check_cancel, check_cancelled
from camkit.runtime.network.tiling import Progress
from camkit.runtime.rows import Rows, RowSource

STEPS: Final = 1000
"""What a stage counts for, whole."""


class Meter:
    """Counts the work of one capture; belongs to one thread."""

    def __init__(self, progress: Progress | None, cancel: Cancel | None) -> None:
        check_cancel(cancel)
        self._progress = progress
        self._cancel = cancel
        self._shares: dict[str, float] = {}
        self._reported_steps = -1

    def expect(self, keys: Sequence[str]) -> None:
        """Start anew; these are the stages that will give rows."""
        self._shares = dict.fromkeys(keys, 0.0)
        self._reported_steps = -1

    def reach(self, key: str, share: float) -> None:
        """Record that a stage has given a share of its rows.

        Raises:
            Cancelled: If the caller asked to stop.
        """
        check_cancelled(self._cancel)
        if share > self._shares.get(key, 1.0):
            self._shares[key] = share
            self._tell()

    def finish(self) -> None:
        """Record that all is done, rows that nobody asked for included."""
        self._shares = dict.fromkeys(self._shares, 1.0)
        self._tell()

    def _tell(self) -> None:
        steps = int(STEPS * sum(self._shares.values()))
        if self._progress is not None and steps > self._reported_steps:
            self._reported_steps = steps
            self._progress(steps, STEPS * len(self._shares))

    def bands(self, key: str, bands: Iterator[Rows], height: int) -> Iterator[Rows]:
        """Yield bands, each counted."""
        self.reach(key, 0.0)
        bottom = 0
        for band in bands:
            bottom += band.shape[1]
            self.reach(key, bottom / height)
            yield band
            del band  # nothing may hold a band while the next one is made


class MeteredRows:
    """A row source whose reading is counted."""

    def __init__(self, source: RowSource, meter: Meter, key: str) -> None:
        self._source = source
        self._meter = meter
        self._key = key

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w) of the whole picture."""
        return self._source.shape

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom of the source."""
        rows = self._source.read(top, bottom)
        self._meter.reach(self._key, bottom / self.shape[1])
        return rows
