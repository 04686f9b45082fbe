"""Time spent since work began: wall time, and CPU time of this process and its children."""

import os
import time
from typing import Self


class Stopwatch:
    """Counts from when it is made."""

    def __init__(self) -> None:
        self._wall_s, self._cpu_s = time.perf_counter(), _cpu_s()

    @classmethod
    def of_process(cls) -> Self:
        """Return one whose CPU time counts from the start of this process."""
        watch = cls()
        watch._cpu_s = 0.0
        return watch

    def wall_s(self) -> float:
        """Return the wall time."""
        return time.perf_counter() - self._wall_s

    def cpu_s(self) -> float:
        """Return the CPU time of all threads, and of children that have ended and were waited for.

        A child at work is counted by whoever started it until then.
        """
        return _cpu_s() - self._cpu_s


def _cpu_s() -> float:
    times = os.times()
    return time.process_time() + times.children_user + times.children_system
