"""Files that appear complete or not at all: written to a part file, fsynced, renamed.

Every writer has a part file of its own, so two processes never write into one another's.
"""

import hashlib
import os
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from camkit.caller import option_text
from camkit.errors import ContractError

PART_SUFFIX: Final = ".part"
MOST_NAME_BYTES: Final = 200
"""Of a file's name within that of its part; file systems allow 255 in all."""
HASH_LETTERS: Final = 16
"""Of the hash of the whole name, which tells names apart that begin alike."""


def refuse_existing(paths: Iterable[Path | None], *, overwrite: bool) -> None:
    """Refuse to write over a file before any work, unless the caller asked for it.

    Raises:
        ContractError: Names those that exist.
    """
    existing = [str(path) for path in paths if path is not None and path.exists()]
    if existing and not overwrite:
        raise ContractError(
            f"{', '.join(existing)} exists; add {option_text('overwrite', value=True)} or choose "
            "another name"
        )


def part_path(path: Path) -> Path:
    """Return a new name under which a file is written before it is complete.

    It is UTF-8 whatever the name itself is: not every library opens other names.
    """
    return path.with_name(f"{_part_prefix(path)}{secrets.token_hex(4)}{PART_SUFFIX}")


def stale_parts(path: Path) -> list[Path]:
    """Return the parts of a file that lie beside it, whoever wrote them."""
    prefix = _part_prefix(path)
    return [
        near
        for near in path.parent.iterdir()
        if near.name.startswith(prefix)
        and near.name.endswith(PART_SUFFIX)
        and "." not in near.name[len(prefix) : -len(PART_SUFFIX)]
    ]


def _part_prefix(path: Path) -> str:
    whole = os.fsencode(path.name)
    name = whole.decode("utf-8", "backslashreplace")
    short = name.encode()[:MOST_NAME_BYTES].decode("utf-8", "ignore")
    return f"{short}.{hashlib.sha256(whole).hexdigest()[:HASH_LETTERS]}."


@contextmanager
def atomic_output(path: Path) -> Iterator[Path]:
    """Yield the path to write one file to; see `atomic_outputs`."""
    with atomic_outputs(path) as (part,):
        yield part


@contextmanager
def atomic_outputs(*paths: Path) -> Iterator[tuple[Path, ...]]:
    """Yield the paths to write to; the files take their real names when the block ends well.

    The content is on the disk before the names are, so that even after a power cut no name stands
    for half a file. When the block raises, or one of the files cannot take its name, nothing new
    is left and older files stay.

    Args:
        *paths: The files to appear, in this order; their folders exist. All parts are named after
            the last one.

    Raises:
        OSError: If a file cannot be written.
    """
    parts = tuple(part_path(path.with_name(paths[-1].name)) for path in paths)
    try:
        yield parts
        for part in parts:
            _sync(part)
        _rename(parts, paths)
    finally:
        for part in parts:
            part.unlink(missing_ok=True)


def write_together(files: Mapping[Path, bytes]) -> None:
    """Write files into folders that are made if they are not there; all of them or none.

    Args:
        files: Path -> content, in the order in which they appear.

    Raises:
        OSError: If one cannot be written.
    """
    for path in files:
        path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_outputs(*files) as parts:
        for part, data in zip(parts, files.values(), strict=True):
            part.write_bytes(data)


def _rename(parts: Sequence[Path], paths: Sequence[Path]) -> None:
    """Rename every part, or none."""
    older: list[tuple[Path, Path | None]] = []
    try:
        for part, path in zip(parts, paths, strict=True):
            older.append((path, _link_backup(path)))
            part.replace(path)
        if os.name == "posix":
            for folder in {path.parent for path in paths}:
                _sync(folder)
    except BaseException:
        for (path, backup), part in zip(
            reversed(older), reversed(parts[: len(older)]), strict=True
        ):
            if backup is not None:
                backup.replace(path)
            elif not part.exists():
                path.unlink(missing_ok=True)
        raise
    finally:
        for _, backup in older:
            if backup is not None:
                backup.unlink(missing_ok=True)


def _link_backup(path: Path) -> Path | None:
    """Link an older file under a second name; None if there is none to replace."""
    if not path.is_file():
        return None
    backup = part_path(path)
    try:
        os.link(path, backup)
    except OSError:  # a file system without second names
        path.rename(backup)
    return backup


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
