"""A journal of finished work, one JSON object per line: a run may be stopped and resumed."""

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from camkit.errors import ContractError

Entry = TypeVar("Entry")


def read_journal(path: Path, parse: Callable[[Mapping[str, Any]], Entry], what: str) -> list[Entry]:
    """Read the entries of an earlier run; a last line that was cut off is left out.

    Args:
        path: The journal; without the file there are no entries.
        parse: Makes an entry of a line; raises TypeError or KeyError for a line of another kind.
        what: An entry in words, for the error.

    Raises:
        ContractError: If another line than the last is damaged.
    """
    if not path.exists():
        return []
    lines = path.read_text(encoding="utf-8").splitlines()
    entries = []
    for number, line in enumerate(lines, start=1):
        try:
            entries.append(parse(json.loads(line)))
        except (json.JSONDecodeError, TypeError, KeyError) as error:
            if number == len(lines):
                break
            raise ContractError(
                f"{path} line {number} is no {what}; remove the file and start over"
            ) from error
    return entries


def append_journal(path: Path, entries: Iterable[Mapping[str, Any]]) -> None:
    """Add finished entries, one line each."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.writelines(json.dumps(entry) + "\n" for entry in entries)
