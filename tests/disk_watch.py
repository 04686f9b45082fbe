"""Tells whether code writes to the disk: every file opened to write, every folder made."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_MAKING = ("os.mkdir", "os.rename", "os.link", "os.symlink", "os.truncate")
_watching: list[list[str]] = []


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    if not _watching:
        return
    if event == "open":
        path, _mode, flags = arguments
        if isinstance(flags, int) and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            _watching[-1].append(f"open {path}")
    elif event in _MAKING:
        _watching[-1].append(f"{event} {arguments}")


sys.addaudithook(_hook)  # hooks cannot be removed, so this one sleeps while nobody watches


@contextmanager
def nothing_written() -> Iterator[None]:
    """Fail if the block writes to the disk."""
    written: list[str] = []
    _watching.append(written)
    try:
        yield
    finally:
        _watching.remove(written)
    assert written == []
