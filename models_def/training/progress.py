"""A progress bar on a terminal, nothing elsewhere."""

import sys
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

BAR_STEPS = 1000


class TrainingBar:
    """Shows how far a run is, its loss and its last validation; a context manager."""

    def __init__(self, title: str) -> None:
        columns = (TextColumn(title), BarColumn(), TextColumn("{task.description}"))
        self._bar = Progress(
            *columns,
            TimeElapsedColumn(),
            console=Console(stderr=True),
            disable=not sys.stderr.isatty(),
        )
        self._task = self._bar.add_task("starting", total=BAR_STEPS)

    def __enter__(self) -> "TrainingBar":
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def show(self, progress: float, step: int, loss: float, valid_db: float | None) -> None:
        """Move the bar."""
        quality = "" if valid_db is None else f", valid {valid_db:.2f} dB"
        text = f"step {step}, loss {loss:.4f}{quality}"
        self._bar.update(self._task, completed=progress * BAR_STEPS, description=text)
