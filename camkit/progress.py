"""Tasks of long work, which the work counts and a listener shows.

    with listening(board):                              the command line
        for scene in counted(scenes, "photographing"):  the work

Without a listener, as in a program that calls camkit, nothing is kept. Threads that the work
starts do not inherit the listener; they are given the task itself.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Final, TypeVar

Item = TypeVar("Item")
LEAST_SHARE: Final = 0.05
"""No time left is known before so much is done, unless a task says otherwise."""


@dataclass(slots=True, kw_only=True, eq=False)
class Task:
    """Work in progress; the work changes `done` and `what`, a listener reads them.

    Attributes:
        what: What is being done: "photographing a.png".
        total: Units in all; None where nobody knows.
        done: Units done.
        unit: Plural noun for the units, "scenes"; None where a share says more than a count.
        is_even: Whether units take about equally long, so that time left follows from those done.
        writes_lines: Whether the work notes lines of its own often enough.
        skipped: Units of `done` that no time was spent on, such as those of an earlier run.
        least_share: Of the units, done before the time left is known; 0 where the first unit is
            as good a sample as any.
        since_s: When it began, in seconds of `time.monotonic`.
    """

    what: str
    total: float | None = None
    done: float = 0.0
    unit: str | None = None
    is_even: bool = True
    writes_lines: bool = False
    skipped: float = 0.0
    least_share: float = LEAST_SHARE
    since_s: float = field(default_factory=time.monotonic)

    def tell(self, what: str) -> None:
        """Set the text of the present work."""
        self.what = what

    def count(self, done: float, total: float | None = None) -> None:
        """Set the number of finished units."""
        self.done, self.total = done, self.total if total is None else total

    def begin(self, done: float) -> None:
        """Start the even part of the work, with so many units done before it."""
        self.done = self.skipped = done
        self.since_s = time.monotonic()

    def left_s(self, now_s: float | None = None) -> float | None:
        """Return the time left, by the work done so far; None where it cannot be predicted.

        Args:
            now_s: Seconds of `time.monotonic`; None for now.
        """
        if not self.total or not self.is_even:
            return None
        fresh, remaining = self.done - self.skipped, self.total - self.done
        if min(fresh, remaining) <= 0 or fresh < self.least_share * self.total:
            return None
        spent_s = (time.monotonic() if now_s is None else now_s) - self.since_s
        return spent_s * remaining / fresh


@dataclass(slots=True, kw_only=True)
class Board:
    """The tasks in progress as a listener sees them, the outermost first.

    Attributes:
        tasks: In progress.
        note: Called with lines that last, such as the result of a validation.
    """

    note: Callable[[str], None]
    tasks: list[Task] = field(default_factory=list)


_board: ContextVar[Board | None] = ContextVar("camkit_progress", default=None)


@contextmanager
def listening(board: Board) -> Iterator[None]:
    """Show the tasks of this thread on a board."""
    token = _board.set(board)
    try:
        yield
    finally:
        _board.reset(token)


@contextmanager
def working(
    what: str,
    total: float | None = None,
    *,
    unit: str | None = None,
    is_even: bool = True,
    writes_lines: bool = False,
) -> Iterator[Task]:
    """Yield a task for the work of this block; see `Task`."""
    task = Task(what=what, total=total, unit=unit, is_even=is_even, writes_lines=writes_lines)
    board = _board.get()
    if board is None:
        yield task
        return
    board.tasks.append(task)
    is_left = False
    try:
        yield task
    except GeneratorExit:
        is_left = True  # a loop that ended early; tasks behind it may be of others by now
        raise
    finally:
        if task in board.tasks:
            at = board.tasks.index(task)
            del board.tasks[at : at + 1 if is_left else None]


def counted(items: Sequence[Item], what: str, unit: str | None = None) -> Iterator[Item]:
    """Yield items, each counted as a unit when the next one is asked for."""
    with working(what, len(items), unit=unit) as task:
        for number, item in enumerate(items):
            task.count(number)
            yield item


def note(line: str) -> None:
    """Send a lasting line to the listener."""
    board = _board.get()
    if board is not None:
        board.note(line)


def duration(seconds: float) -> str:
    """Return a time as people say it."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 600:
        return f"{whole // 60} min {whole % 60:02} s"
    return f"{whole / 60:.0f} min" if whole < 6000 else f"{whole / 3600:.1f} h"


def left_text(task: Task) -> str:
    """Return the time left as the end of a line, empty where it is not known."""
    left_s = task.left_s()
    return "" if left_s is None else f", about {duration(left_s)} left"
