"""The display of tasks in progress, on stderr: a rewritten line on a terminal, else plain lines.

    camkit process: 3 of 12 pictures, 25 %; a.dng; 41 s so far, about 2 min left

Nothing is shown for what ends within `SILENT_S`. Times left come from work done so far.
"""

import os
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Final

from camkit.cli.say import erase, is_terminal, say, say_over
from camkit.progress import Board, Task, duration, listening

SILENT_S: Final = 2.0
REDRAW_S: Final = 0.5
LINE_S: Final = 10.0
"""Between plain lines, where there is something new to say."""
STILL_S: Final = 30.0
"""Between plain lines that only say that the work goes on."""
FALLBACK_COLUMNS: Final = 80
MOST_LINES: Final = 20
"""Lines are further apart in long runs: by the time so far over this number."""


class Display:
    """Shows the tasks of one command; `tick` is called by a clock of its own or by a test."""

    def __init__(self, name: str) -> None:
        self.board = Board(note=self._note)
        self._name = name
        self._is_terminal = is_terminal()
        self._start_s = time.monotonic()
        self._last_s: float | None = None
        self._last_state: object = None
        self._has_begun = self._has_left = False
        self._kept_lines: list[str] = []
        self._lock = threading.RLock()

    def tick(self, now_s: float) -> None:
        """Show the changes, if it is time to."""
        with self._lock:
            tasks = outer(list(self.board.tasks))
            self._has_begun |= bool(tasks)
            spent_s = now_s - self._start_s
            if spent_s < SILENT_S or not (self._has_begun or spent_s > LINE_S):
                return
            self.flush()
            left_line = time_left(tasks, now_s)
            text = tasks_text(tasks) or ("working" if self._has_begun else "starting")
            line = f"{self._name}: {text}; {duration(spent_s)} so far{left_line}"
            if self._is_terminal:
                say_over(line[: _columns() - 1])
            elif self._is_time(tasks, now_s, is_first_left=bool(left_line) and not self._has_left):
                self._last_s = now_s
                self._has_left = bool(left_line)
                say(line, err=True)

    def flush(self) -> None:
        """Print the lines that were kept back."""
        with self._lock:
            for line in self._kept_lines:
                say(line, err=True)
            self._kept_lines.clear()

    def _is_time(self, tasks: Sequence[Task], now_s: float, *, is_first_left: bool) -> bool:
        """Return whether a plain line is due."""
        state = [(task.what, task.done) for task in tasks]
        changed, self._last_state = state != self._last_state, state
        if self._last_s is None:
            return True
        if any(task.writes_lines for task in tasks):
            return False
        gap_s = SILENT_S if is_first_left else LINE_S if changed else STILL_S
        if now_s - self._last_s >= max(gap_s, (now_s - self._start_s) / MOST_LINES):
            return True
        if changed:
            self._last_state = None  # still new when its time comes
        return False

    def _note(self, line: str) -> None:
        with self._lock:
            now_s = time.monotonic()
            if self._last_s is None and now_s - self._start_s < SILENT_S:
                self._kept_lines.append(line)
                return
            self._last_s = now_s
            say(line, err=True)


def _columns() -> int:
    """Return the width of the terminal on stderr; stdout may go elsewhere."""
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns or FALLBACK_COLUMNS
    except (OSError, ValueError, AttributeError):
        return FALLBACK_COLUMNS


def outer(tasks: Sequence[Task]) -> list[Task]:
    """Return nested tasks down to the first that is counted evenly; tasks in it change often."""
    for number, task in enumerate(tasks):
        if task.is_even and (task.total or task.unit) and not _is_one(task):
            return list(tasks[: number + 1])
    return list(tasks)


def _is_one(task: Task) -> bool:
    """Return whether a task is a single unit without a known share: the tasks in it say more."""
    return task.total == 1 and task.unit is not None and task.done in (0, 1)


def tasks_text(tasks: Sequence[Task]) -> str:
    """Return nested tasks as one line."""
    return " ".join("; ".join(map(_text, tasks)).split())


def time_left(tasks: Sequence[Task], now_s: float) -> str:
    """Return the end of a line: the time left of the innermost task, or nothing."""
    left_s = tasks[-1].left_s(now_s) if tasks else None
    if left_s is None:
        return ""
    return f", about {duration(left_s)} left" + (" of this step" if len(tasks) > 1 else "")


def _text(task: Task) -> str:
    if not task.total:
        return task.what
    if task.unit is None and not task.is_even:
        return f"step {min(task.done + 1, task.total):.0f} of {task.total:.0f}: {task.what}"
    counts = task.unit is not None and task.total > 1
    shows_share = task.is_even and not _is_one(task)
    count = f", {int(task.done)} of {task.total:.0f} {task.unit}" if counts else ""
    percent = f", {100 * min(1.0, task.done / task.total):.0f} %" if shows_share else ""
    return task.what + count + percent


@contextmanager
def showing_progress(name: str) -> Iterator[None]:
    """Show the tasks of this block."""
    display, is_over = Display(name), threading.Event()

    def run() -> None:
        wait_s = SILENT_S
        with suppress(OSError, ValueError):  # nobody reads stderr any more
            while not is_over.wait(wait_s):
                display.tick(time.monotonic())
                wait_s = REDRAW_S

    clock = threading.Thread(target=run, name="camkit-progress", daemon=True)
    clock.start()
    try:
        with listening(display.board):
            yield
    except BaseException:
        display.flush()
        raise
    finally:
        is_over.set()
        clock.join()
        erase()
