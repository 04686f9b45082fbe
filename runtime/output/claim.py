"""Claims of outputs: of several processes on one folder exactly one makes an output.

A claim is a lock of the system on `NAME.ext.claim`. It ends with the process that holds it, even
when that is killed; the next process that claims the output removes what was left half made.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from camkit.runtime.output.part_file import stale_parts

try:
    import fcntl
except ImportError:  # Windows: nothing is claimed, part files still have names of their own
    fcntl = None  # type: ignore[assignment]

CLAIM_SUFFIX: Final = ".claim"


@contextmanager
def claimed(output: Path) -> Iterator[bool]:
    """Claim an output; yield whether this process may make it.

    Where the system has no locks (or the file system none), every claim is granted.

    Args:
        output: The file that will appear; its folder exists.

    Raises:
        OSError: If no file can be made in the folder.
    """
    path = output.with_name(output.name + CLAIM_SUFFIX)
    descriptor = _lock(path)
    if descriptor is None:
        yield False
        return
    try:
        for part in stale_parts(output):
            part.unlink(missing_ok=True)
        yield True
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)


def was_claimed(output: Path) -> bool:
    """Return whether an output is claimed now, or whoever claimed it last has died of it."""
    return output.with_name(output.name + CLAIM_SUFFIX).exists()


def _lock(path: Path) -> int | None:
    """Open and lock the file of a claim; None if another holds it."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            if fcntl is not None:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_still(path, descriptor):
                return descriptor
        except BlockingIOError:
            os.close(descriptor)
            return None
        except OSError:  # a file system without locks
            return descriptor
        os.close(descriptor)


def _is_still(path: Path, descriptor: int) -> bool:
    """Return whether the name still stands for the open file: its last holder removes it."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False
