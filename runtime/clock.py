"""Seconds per stage when stages pull rows from one another: each second counts once."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from camkit.runtime.rows import Rows, RowSource


class StageClock:
    """A stack of running stages; only the innermost one is charged.

    One clock belongs to one capture and one thread.

    Attributes:
        seconds: Wall seconds per stage.
        cpu_seconds: CPU seconds of all threads of this process while a stage ran; what runs
            beside the stages, such as the writer's thread, is charged to them too.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.cpu_seconds: dict[str, float] = {}
        self._running: list[str] = []
        self._start_s = 0.0
        self._cpu_start_s = 0.0

    @property
    def running(self) -> str | None:
        """Name the innermost stage that runs now; may be asked from another thread."""
        running = self._running[-1:]
        return running[0] if running else None

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Count the time inside the block for `name`, and no longer for the stage around it."""
        self._charge()
        self._running.append(name)
        try:
            yield
        finally:
            self._charge()
            self._running.pop()

    def bands(self, name: str, bands: Iterator[Rows]) -> Iterator[Rows]:
        """Yield bands, and count the making of each for `name`."""
        while True:
            with self.stage(name):
                band = next(bands, None)
            if band is None:
                return
            yield band
            del band  # nothing may hold a band while the next one is made

    def _charge(self) -> None:
        now, cpu = time.perf_counter(), time.process_time()
        if self._running:
            name = self._running[-1]
            self.seconds[name] = self.seconds.get(name, 0.0) + now - self._start_s
            self.cpu_seconds[name] = self.cpu_seconds.get(name, 0.0) + cpu - self._cpu_start_s
        self._start_s, self._cpu_start_s = now, cpu


class TimedRows:
    """A row source whose reading is charged to a stage."""

    def __init__(self, source: RowSource, clock: StageClock, name: str) -> None:
        self._source = source
        self._clock = clock
        self._name = name

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (channel, h, w) of the whole picture."""
        return self._source.shape

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom of the source."""
        with self._clock.stage(self._name):
            return self._source.read(top, bottom)
