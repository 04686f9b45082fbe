"""Faults planted one at a time: the Nth call of what can fail fails, or kills the process.

    ways to fail: open, write, fsync, rename, start of a child, array allocation

Native writers (OpenEXR) are caught where Python hands them rows.
"""

import builtins
import io
import os
import signal
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

LEAST_ARRAY_BYTES: Final = 20_000
"""Allocations from this size on may fail; pictures of these tests are small."""
_MAKERS: Final = ("empty", "zeros", "ones", "full", "empty_like", "zeros_like", "concatenate")


@dataclass
class Faults:
    """Counts what can fail, and lets one of it fail.

    Attributes:
        at: Number of the call that fails; None for none.
        kill: The call ends the process instead of failing.
        seen: What was called so far, in order.
    """

    at: int | None = None
    kill: bool = False
    seen: list[str] = field(default_factory=list)
    _lock: Any = field(default_factory=threading.Lock)

    def pass_by(self, what: str, error: type[Exception]) -> None:
        """Count a call; fail if its turn has come."""
        with self._lock:
            self.seen.append(what)
            due = len(self.seen) - 1 == self.at
        if due and self.kill:
            os.kill(os.getpid(), signal.SIGKILL)
        if due:
            raise MemoryError if error is MemoryError else OSError(28, "No space left on device")

    def plant(self) -> None:
        """Replace what can fail; for processes that end soon, since nothing is put back."""
        self._plant_open()
        for name in ("fsync", "replace", "rename", "link"):
            self._plant_call(os, name, OSError)
        self._plant_call(subprocess, "Popen", OSError)
        for name in _MAKERS:
            self._plant_maker(name)
        import OpenEXR

        real = OpenEXR.OutputFile

        def open_exr(*given: Any) -> Any:
            self.pass_by("open EXR", OSError)
            return _WrittenExr(real(*given), self)

        OpenEXR.OutputFile = open_exr

    def _plant_call(self, module: Any, name: str, error: type[Exception]) -> None:
        real = getattr(module, name)
        if isinstance(real, type):

            def start(this: Any, *given: Any, **named: Any) -> None:
                self.pass_by(name, error)
                real.__init__(this, *given, **named)

            setattr(module, name, type(name, (real,), {"__init__": start}))
            return

        def call(*given: Any, **named: Any) -> Any:
            self.pass_by(name, error)
            return real(*given, **named)

        setattr(module, name, call)

    def _plant_maker(self, name: str) -> None:
        real: Callable[..., Any] = getattr(np, name)

        def make(*given: Any, **named: Any) -> Any:
            made = real(*given, **named)
            if made.nbytes >= LEAST_ARRAY_BYTES:
                self.pass_by(f"np.{name}", MemoryError)
            return made

        setattr(np, name, make)

    def _plant_open(self) -> None:
        real, real_os = io.open, os.open

        def open_(file: Any, mode: str = "r", *given: Any, **named: Any) -> Any:
            self.pass_by("open", OSError)
            opened = real(file, mode, *given, **named)
            return _Written(opened, self) if set(mode) & set("wax+") else opened

        def open_os(*given: Any, **named: Any) -> int:
            self.pass_by("os.open", OSError)
            return real_os(*given, **named)

        io.open = builtins.open = open_  # type: ignore[assignment]
        os.open = open_os  # type: ignore[assignment]


class _Written:
    """A file whose writes may fail."""

    def __init__(self, file: Any, faults: Faults) -> None:
        self._file, self._faults = file, faults

    def write(self, content: Any) -> int:
        """Write, unless it is the turn of this call to fail."""
        self._faults.pass_by("write", OSError)
        return int(self._file.write(content))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def __enter__(self) -> "_Written":
        return self

    def __exit__(self, *_: Any) -> None:
        self._file.close()


class _WrittenExr:
    """An EXR file whose writes may fail."""

    def __init__(self, file: Any, faults: Faults) -> None:
        self._file, self._faults = file, faults

    def writePixels(self, *given: Any) -> None:  # noqa: N802 - the library's name
        """Write rows, unless it is the turn of this call to fail."""
        self._faults.pass_by("write EXR", OSError)
        self._file.writePixels(*given)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)
