"""The one way to a terminal: texts of files, bundles and errors lose what would steer it."""

import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import typer

_STEERING: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""Control characters but tab and newline, what turns the direction of text, lone surrogates."""
_ERASED: Final = "\r\033[K"
_rewritten = threading.Event()
"""Set while the last line of the terminal is one that `say_over` printed."""
_lock = threading.RLock()


def is_terminal() -> bool:
    """Return whether stderr is a terminal; it may be closed, or absent in programs with windows."""
    try:
        return sys.stderr is not None and sys.stderr.isatty()
    except ValueError:
        return False


def plain(text: str) -> str:
    """Return a text with its control characters as visible escapes."""
    return _STEERING.sub(lambda match: ascii(match[0])[1:-1], text)


def say(text: str, *, err: bool = False) -> None:
    """Print a text of any origin, on stdout or stderr, in place of a line of `say_over`."""
    with _lock:
        erase()
        typer.echo(plain(text), err=err)


def say_over(text: str) -> None:
    """Print a line on the stderr of a terminal over the one before it."""
    with _lock:
        _rewritten.set()
        typer.echo(_ERASED + plain(text), err=True, nl=False)


@contextmanager
def said_together() -> Iterator[None]:
    """Keep the lines of this block together, whatever other threads print."""
    with _lock:
        yield


def erase() -> None:
    """Remove the line of `say_over`, if there is one."""
    with _lock:
        if _rewritten.is_set():
            _rewritten.clear()
            if is_terminal():
                typer.echo(_ERASED, err=True, nl=False)
