"""Files that appear complete or not at all: written to `.part`, fsynced, renamed."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def part_path(path: Path) -> Path:
    """Give the name under which a file is written before it is complete.

    It is UTF-8 whatever the name itself is: not every library opens other names.
    """
    name = os.fsencode(path.name).decode("utf-8", "backslashreplace")
    return path.with_name(f"{name}.part")


@contextmanager
def atomic_output(path: Path) -> Iterator[Path]:
    """Give the path to write to; the file takes its real name when the block ends well.

    The content is on the disk before the name is, so that even after a power cut the name never
    stands for half a file. When the block raises, nothing is left and an older file stays.

    Args:
        path: The file to appear; its folder exists.

    Raises:
        OSError: If the file cannot be written.
    """
    part = part_path(path)
    part.unlink(missing_ok=True)
    try:
        yield part
        _sync(part)
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    if os.name == "posix":
        _sync(path.parent)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
