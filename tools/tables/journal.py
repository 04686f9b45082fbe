"""A journal by the hash of all that decides an entry: what is there is not measured again."""

import hashlib
import json
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

from camkit.report.journal import append_journal, read_journal

Entry = dict[str, Any]


class Journal:
    """Entries of a file, a line of JSON each."""

    def __init__(self, path: Path) -> None:
        self._path = path
        lines = read_journal(path, lambda line: {**line, "key": line["key"]}, "measurement")
        self._entries: dict[str, Entry] = {line["key"]: line for line in lines}

    def entry(self, key: str, make: Callable[[], Entry]) -> Entry:
        """Return the entry of a key, which is made and written down where it is not known."""
        if key not in self._entries:
            entry = json.loads(json.dumps({"key": key, **make()}))
            append_journal(self._path, [entry])
            self._entries[key] = entry
        return self._entries[key]


def digest(*parts: object) -> str:
    """Return a hash of all that decides an entry: bytes, and the text of other values."""
    hasher = hashlib.sha256()
    for part in parts:
        hasher.update((part if isinstance(part, bytes) else str(part).encode()) + b"\n")
    return hasher.hexdigest()


@lru_cache
def file_digest(path: Path) -> str:
    """Return the hash of a file, which is read once."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
