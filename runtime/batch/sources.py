"""Captures named by files, folders and globs, each capture once."""

import glob
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from camkit.errors import DecodeError
from camkit.kinds import Kind, all_kinds
from camkit.regular_file import check_regular
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.output.sidecar import read_sidecar
from camkit.runtime.signal.halves import Halves, without_right_halves

RAW_SUFFIXES: Final = frozenset(
    {".dng", ".arw", ".cr2", ".cr3", ".crw", ".nef", ".nrw", ".raf", ".rw2", ".orf", ".pef"}
    | {".srw", ".kdc", ".dcr", ".3fr", ".iiq", ".rwl"}
)
CAPTURE_SUFFIXES: Final = RAW_SUFFIXES | {".exr", ".tif", ".tiff", ".png"}


def expand(
    files: Sequence[FilePath],
    kind: Kind | None = None,
    halves: Halves | None = None,
    on_unmatched: Callable[[str], None] | None = None,
) -> list[Path]:
    """Return the captures named by files, folders and globs, each once, in the order given.

    A folder stands for the captures directly in it, by name, without the pictures that a sidecar
    beside them calls its output; a glob that matches nothing and a
    folder without captures stand for nothing; a file that does not exist is kept and fails later.

    Args:
        files: What was named.
        kind: Of the captures, where that is known: a folder stands for its types of files alone.
        halves: What differs in the paths of two halves of a capture, which the left one names.
        on_unmatched: Called with each glob and folder that stands for nothing.
    """
    suffixes = _suffixes(kind)
    paths: dict[Path, None] = {}
    for item in files:
        matches = _matches(item, suffixes)
        if not matches and on_unmatched is not None:
            on_unmatched(str(item))
        paths.update(dict.fromkeys(matches))
    return without_right_halves(list(paths), halves)


def unmatched_text(names: Sequence[str]) -> str:
    """Return the notice about globs and folders that stand for nothing."""
    return f"no capture matches {', '.join(names)}"


def _matches(item: FilePath, suffixes: frozenset[str]) -> list[Path]:
    path = Path(item)
    if _is_unreachable(path):
        return [path]
    if path.is_dir():
        inside = sorted(p for p in path.iterdir() if p.suffix.lower() in suffixes)
        return [p for p in inside if p.is_file() and not is_result(p)]
    if not path.exists() and glob.has_magic(str(item)):
        # pathlib has no glob that takes an absolute pattern
        matches = sorted(Path(m) for m in glob.glob(str(item), recursive=True))  # noqa: PTH207
        return [p for p in matches if p.is_file()]
    return [path]


def _suffixes(kind: Kind | None) -> frozenset[str]:
    if kind is None:
        return CAPTURE_SUFFIXES.union(*(each.file_types for each in all_kinds()))
    suffixes = frozenset({*kind.file_types, *kind.shared_types})
    return suffixes or CAPTURE_SUFFIXES


def _is_unreachable(path: Path) -> bool:
    """Return whether no file can have a path: a long name, a byte 0, a loop of links."""
    try:
        path.stat()
    except FileNotFoundError:
        return False
    except (OSError, ValueError):
        return True
    return False


def is_result(path: Path) -> bool:
    """Return whether the sidecar of a picture calls it an output."""
    record = read_sidecar(path)
    if record is None:
        return False
    extra_names = record.get("beside", [])
    names = [record["output"], *(extra_names if isinstance(extra_names, list) else [])]
    return path.name in {Path(str(name)).name for name in names}


def refusal_of(source: Path) -> str | None:
    """Return why an input cannot be read, as far as that is known without opening it."""
    try:
        check_regular(source)
    except OSError as error:
        return f"cannot read {source}: {error.strerror or error}"
    except (DecodeError, ValueError) as error:
        return f"cannot read {source}: {error}"
    return None
