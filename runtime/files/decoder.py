"""The decoding child: started with its order, or ahead of it while its parent still imports.

    decoder_ahead()    a child makes itself ready beside this process; the first order goes to it
    decoder_of(order)  that child, or a fresh one

What a child imports takes a quarter of a second, which one photograph need not wait for. Imports
the standard library alone, since the command line does so before anything else.
"""

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

import camkit

WORKER: Final = "camkit.runtime.raw_worker"


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoder:
    """A child.

    Attributes:
        child: Its process; what it decodes comes through its stdout.
        complaints: What it says on stderr.
    """

    child: subprocess.Popen[bytes]
    complaints: IO[bytes]

    def take(self, order: Sequence[str]) -> bool:
        """Send a waiting child its order; return whether it still waited."""
        pipe = self.child.stdin
        if pipe is None or self.child.poll() is not None:
            return False
        try:
            pipe.write(json.dumps(list(order)).encode() + b"\n")
            pipe.close()
        except OSError:
            return False
        return True

    def end(self) -> None:
        """Stop the child and close its pipes."""
        self.child.kill()
        with contextlib.suppress(OSError), self.child:
            pass
        self.complaints.close()


_AHEAD: Final[deque[Decoder]] = deque()
"""Children that wait, for whichever thread is first; taking one of a deque is atomic."""


@contextmanager
def decoder_ahead() -> Iterator[None]:
    """Start a child that prepares itself; it gets the first order of any thread."""
    decoder = _started([str(os.getpid())], stdin=subprocess.PIPE)
    _AHEAD.append(decoder)
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):  # it was given an order, which ends it
            _AHEAD.remove(decoder)
            decoder.end()


@contextmanager
def decoder_of(order: Sequence[str]) -> Iterator[Decoder]:
    """Yield a child that has its order; it ends with the block.

    Args:
        order: The worker's arguments.
    """
    decoder = _waiting(order) or _started(order, stdin=subprocess.DEVNULL)
    try:
        yield decoder
    finally:
        decoder.end()


def _waiting(order: Sequence[str]) -> Decoder | None:
    """Return the child that was started ahead, with its order; None without one."""
    try:
        decoder = _AHEAD.pop()
    except IndexError:
        return None
    if decoder.take(order):
        return decoder
    decoder.end()
    return None


def _started(arguments: Sequence[str], *, stdin: int) -> Decoder:
    complaints = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `Decoder.end`
    command = [
        sys.executable,
        "-P",  # the folder the user happens to be in must not provide modules
        "-m",
        WORKER,
        *arguments,
    ]
    try:
        child = subprocess.Popen(
            command,
            stdin=stdin,
            stdout=subprocess.PIPE,
            stderr=complaints,
            env=child_environment(),
            process_group=0,  # an interrupt is for the parent, which then ends the child
        )
    except BaseException:
        complaints.close()
        raise
    return Decoder(child=child, complaints=complaints)


def child_environment() -> dict[str, str]:
    """Return the variables of a decoding child.

    Threads reserve address space (stacks, arenas), which on a machine with many cores would fill
    the memory limit by itself; decoding uses few of them anyway. LibRaw takes the date of a file
    through the time zone, which must not change with the machine.
    """
    threads = {"OMP_NUM_THREADS": "4"}
    return {**threads, **camkit_environment(), "OPENBLAS_NUM_THREADS": "1", "TZ": "UTC"}


def camkit_environment() -> dict[str, str]:
    """Return variables that lead a child to this camkit, also one that is not installed."""
    environment = dict(os.environ)
    root = str(Path(camkit.__file__).resolve().parents[1])
    if not root.endswith(("site-packages", "dist-packages")):
        search_path = environment.get("PYTHONPATH")
        environment["PYTHONPATH"] = os.pathsep.join([*([search_path] if search_path else []), root])
    return environment
