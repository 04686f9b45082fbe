"""Classify worker deaths (memory, crash, lost host): files are followed from worker to worker."""

from collections.abc import Mapping, Sequence
from typing import Final, Literal

from camkit.runtime.batch.tasks import Task
from camkit.runtime.output.claim import was_claimed

SUSPECT: Final = 2
HOPELESS: Final = 4
"""Workers that a file lost: then it is tried with no other under way; then it has failed."""

Fate = Literal["again", "alone", "failed"]


class Losses:
    """The workers that every file of a run has lost."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        self._tasks = tasks
        self._counts = [0] * len(tasks)
        self._at: dict[str, str] = {}
        self._unplaced: set[str] = set()

    def follow(
        self, tasks_by_worker: Mapping[str, frozenset[str]], under_way: Mapping[str, int]
    ) -> list[str]:
        """Update the places of files, and count their losses since the last time.

        The scheduler looks for a worker when a task comes and when a worker comes; what a worker
        is given later (`remote.offer`) makes it look no more. So a task may be left with nobody.

        Args:
            tasks_by_worker: Address of a worker -> keys of the tasks that it has got.
            under_way: Key -> number of the file.

        Returns:
            Keys of tasks to take back: nobody has got them, or they want to be tried alone.
        """
        at = {key: address for address, keys in tasks_by_worker.items() for key in keys}
        back = []
        for key, number in under_way.items():
            was = self._at.get(key)
            its_worker_died = was is not None and was not in tasks_by_worker
            nobody_has_it = key not in at and key in self._unplaced
            died = its_worker_died or (nobody_has_it and was_claimed(self._tasks[number].target))
            self._counts[number] += died
            if nobody_has_it or (died and self._counts[number] >= SUSPECT):
                back.append(key)
        self._unplaced = {key for key in under_way if key not in at}
        self._at = at
        return back

    def add_all(self, number: int, *, was_alone: bool) -> None:
        """Count what dask does not hand out any more: it has lost one worker after the other."""
        self._counts[number] = HOPELESS if was_alone else max(self._counts[number], SUSPECT)

    def fate(self, number: int) -> Fate:
        """Return the fate of a file that lost its worker."""
        if self._counts[number] >= HOPELESS:
            return "failed"
        return "alone" if self._counts[number] >= SUSPECT else "again"
