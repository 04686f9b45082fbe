"""Progress of a batch: the pictures done, and the shares of those under way."""

import threading
from collections.abc import Callable
from pathlib import Path

from camkit.progress import Task
from camkit.runtime.batch.making import FileProgress
from camkit.runtime.development import FileResult


class PictureCount:
    """Counts pictures as units of a task; safe to call from the working threads."""

    def __init__(
        self,
        task: Task,
        on_progress: FileProgress | None,
        on_result: Callable[[FileResult], None] | None,
    ) -> None:
        self._task, self._on_progress, self._on_result = task, on_progress, on_result
        self._lock = threading.Lock()
        self._results = 0
        self._shares: dict[Path, float] = {}

    def progress(self, file: Path, steps: int, total: int) -> None:
        """Record the finished share of a picture, and report it."""
        with self._lock:
            self._shares[file] = steps / max(total, 1)
            self._show(file)
        if self._on_progress is not None:
            self._on_progress(file, steps, total)

    def result(self, result: FileResult) -> None:
        """Record that a picture is done, skipped or failed."""
        with self._lock:
            self._shares.pop(result.input, None)
            self._results += 1
            self._task.skipped += result.status == "skipped"
            self._show(next(iter(self._shares), None))
        if self._on_result is not None:
            self._on_result(result)

    def _show(self, file: Path | None) -> None:
        if file is not None:
            self._task.tell(f"making {file.name}")
        self._task.count(self._results + sum(self._shares.values()))
