"""Progress for people on stderr, and only on a terminal; results on stdout."""

import json
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from camkit.cli.say import plain, say

if TYPE_CHECKING:
    from rich.progress import TaskID

    from camkit.runtime.development import FileResult


class TileProgress:
    """One bar per running file; safe to call from the working threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._bars: dict[Path, TaskID] = {}
        self._live = None
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import Progress

            # Redirected, results meant for a file or pipe would go to the terminal instead.
            self._live = Progress(
                console=Console(stderr=True),
                transient=True,
                redirect_stdout=False,
                redirect_stderr=False,
            )

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.stop()

    @property
    def teller(self) -> Callable[[Path, int, int], None] | None:
        """Give `tile`; None where nobody would see it: from another machine it costs messages."""
        return None if self._live is None else self.tile

    def tile(self, file: Path, done: int, total: int) -> None:
        """Show that `done` of `total` tiles of a file are finished."""
        if self._live is None:
            return
        from rich.markup import escape

        with self._lock:
            if file not in self._bars:
                self._bars[file] = self._live.add_task(escape(plain(file.name)), total=total)
            self._live.update(self._bars[file], completed=done)

    def result(self, result: "FileResult", *, as_json: bool) -> None:
        """Print one file's result: JSON or a line on stdout, failures on stderr."""
        with self._lock:
            bar = self._bars.pop(result.input, None)
            if self._live is not None and bar is not None:
                self._live.remove_task(bar)
            with self._apart():
                _print(result, as_json=as_json)

    def notice(self, text: str) -> None:
        """Print what concerns no single file."""
        with self._lock, self._apart():
            say(f"camkit: {text}", err=True)

    @contextmanager
    def _apart(self) -> Iterator[None]:
        """Let bars and lines not share a line."""
        if self._live is None:
            yield
            return
        self._live.stop()
        yield
        self._live.start()


def _print(result: "FileResult", *, as_json: bool) -> None:
    if as_json:
        say(json.dumps(result.to_json()))
    elif result.status == "failed":
        say(f"{result.input}: failed: {result.error}", err=True)
    else:
        _print_result(result)


def _print_result(result: "FileResult") -> None:
    total = sum(result.seconds.values())
    head = f"{result.input} -> {result.output}"
    if result.status == "skipped":
        say(f"{head}: {'; '.join(result.warnings) or 'done before'}, skipped")
        return
    stages = ", ".join(f"{name} {value:.2f}" for name, value in result.seconds.items())
    say(f"{head}: {total:.2f} s ({stages}), peak {result.peak_rss_mb:.0f} MB")
    for warning in result.warnings:
        say(f"  note: {warning}", err=True)
