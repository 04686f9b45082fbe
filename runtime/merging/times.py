"""Exposure times as people state them: seconds on the command line, or a list in a file."""

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.runtime.files.in_memory import FilePath
from camkit.side_file import read_side_text

COMMENT: Final = "#"
MOST_LIST_BYTES: Final = 1 << 20


def stated_times(
    text: FilePath | Sequence[float], files: Sequence[Path], darks: Sequence[Path] = ()
) -> tuple[float, ...]:
    """Return the exposure time of every file, then of every dark frame.

    Args:
        text: Seconds, or a text of them separated by commas, in the order of the files; or the
            path of a list with lines `NAME SECONDS`, of which further words, comments (`#`) and
            names that are not among the files are skipped. Seconds may be fractions, 1/60.
        files: The frames.
        darks: Their dark frames.

    Returns:
        One time in seconds for each file, then for each dark frame.

    Raises:
        ContractError: If a time is missing, is stated twice, or is no time.
        DecodeError: If the list cannot be read.
    """
    if isinstance(text, str | os.PathLike):
        words = os.fspath(text).split(",")
    else:
        words = [str(seconds) for seconds in text]
    seconds = [_seconds(word) for word in words]
    if all(s is not None for s in seconds):
        if len(seconds) != len(files) + len(darks):
            and_darks = f" and {len(darks)} dark frames" if darks else ""
            raise ContractError(
                f"{option_text('times_s')} states {len(seconds)} times for {len(files)} "
                f"files{and_darks}; state one for each"
            )
        return tuple(_checked(s, option_text("times_s")) for s in seconds if s is not None)
    listed = _read_list(Path(",".join(words)))
    missing = [path.name for path in (*files, *darks) if path.name not in listed]
    if missing:
        raise ContractError(
            f"{text} states no time for {', '.join(missing[:3])}; expected lines NAME SECONDS"
        )
    return tuple(listed[path.name] for path in (*files, *darks))


def _read_list(path: Path) -> dict[str, float]:
    if not path.is_file():
        raise ContractError(
            f"{option_text('times_s')} takes seconds separated by commas, or a file with lines "
            f"NAME SECONDS; got {str(path)!r}"
        )
    try:
        text = read_side_text(path, "the list of times", most_bytes=MOST_LIST_BYTES)
    except ContractError as error:
        raise DecodeError(f"{path} cannot be read as a list of times: {error}") from error
    listed: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition(COMMENT)[0].split()
        if not words:
            continue
        seconds = _seconds(words[1]) if len(words) > 1 else None
        if seconds is None:
            raise ContractError(f"{path}, line {number}: expected NAME SECONDS; got {line[:60]!r}")
        if words[0] in listed:
            raise ContractError(f"{path}, line {number}: {words[0]} is stated twice")
        listed[words[0]] = _checked(seconds, f"{path}, line {number}")
    return listed


def _seconds(word: str) -> float | None:
    """Read a number or a fraction; None for anything else."""
    above, slash, below = word.partition("/")
    try:
        return float(above) / float(below) if slash else float(above)
    except (ValueError, ZeroDivisionError):
        return None


def _checked(seconds: float, where: str) -> float:
    if not (math.isfinite(seconds) and seconds > 0):
        raise ContractError(f"{where}: an exposure time must be > 0 s; got {seconds:g}")
    return seconds
