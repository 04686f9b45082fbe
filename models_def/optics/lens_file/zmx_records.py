"""The lines of a .zmx file, sorted into the system and its surfaces; nothing is interpreted yet."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from camkit.errors import DecodeError

MAX_SURFACES: Final = 1000
MAX_NUMBER: Final = 1e12
MAX_TERM: Final = 1e100
"""Of PARM: the coefficient of r^16 in metres is 1e45 times that in millimetres."""
_MOST: Final = 40

_SURFACE_KEYS: Final = frozenset(
    {"TYPE", "COMM", "STOP", "CURV", "DISZ", "GLAS", "CONI", "PARM", "DIAM", "MEMA", "CLAP", "FLAP"}
)
"""They belong to the surface above them even where a file is not indented."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """One line: its number in the file, its key, its words and all its text after the key."""

    line: int
    key: str
    words: tuple[str, ...]
    text: str

    def number(self, position: int, default: float | None = None) -> float:
        """Return a word as a number.

        Raises:
            DecodeError: If it is missing without default, not finite or beyond `MAX_NUMBER`
                (`MAX_TERM` for PARM).
        """
        if position >= len(self.words):
            if default is not None:
                return default
            raise DecodeError(f"line {self.line}: {self.key} needs {position + 1} values")
        word = self.words[position]
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not abs(value) <= (MAX_TERM if self.key == "PARM" else MAX_NUMBER):
            raise DecodeError(
                f"line {self.line}: {self.key} needs a finite number; got {word[:_MOST]!r}"
            )
        return value

    def numbers(self) -> tuple[float, ...]:
        """Return all words as numbers."""
        return tuple(self.number(i) for i in range(len(self.words)))


Records = Mapping[str, list[Record]]
"""By key, in the order of the file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZmxRecords:
    """A file: what stands outside the surfaces, and each surface from the object to the image."""

    system: Records
    surfaces: tuple[Records, ...]


def parse_records(text: str) -> ZmxRecords:
    """Sort the lines of a file; one that begins at SURF 1 has an empty object in front.

    Raises:
        DecodeError: If it has fewer than three surfaces, more than `MAX_SURFACES`, or their
            numbers do not run 0, 1, 2, ...; the message gives the line.
    """
    system: dict[str, list[Record]] = {}
    surfaces: list[dict[str, list[Record]]] = []
    for record, indented in _records(text):
        if record.key == "SURF":
            if not surfaces and record.words[:1] == ("1",):
                surfaces.append({})
            _check_number(record, len(surfaces))
            surfaces.append({})
            continue
        inside = bool(surfaces) and (indented or record.key in _SURFACE_KEYS)
        place = surfaces[-1] if inside else system
        place.setdefault(record.key, []).append(record)
    if len(surfaces) < 3:
        raise DecodeError(
            f"a .zmx file needs SURF blocks for object, lens and image; got {len(surfaces)} "
            "(is it truncated, or no lens file?)"
        )
    return ZmxRecords(system=system, surfaces=tuple(surfaces))


def _records(text: str) -> Iterator[tuple[Record, bool]]:
    for number, line in enumerate(text.splitlines(), start=1):
        key, _, rest = line.strip().partition(" ")
        if key:
            record = Record(line=number, key=key.upper(), words=tuple(rest.split()), text=rest)
            yield record, line[0] in " \t"


def _check_number(record: Record, expected: int) -> None:
    if expected >= MAX_SURFACES:
        raise DecodeError(f"line {record.line}: more than {MAX_SURFACES} surfaces")
    if record.number(0) != expected:
        raise DecodeError(
            f"line {record.line}: expected SURF {expected}; got SURF {record.words[0][:_MOST]}"
        )


def last(records: Records, key: str) -> Record | None:
    """Return the last record of a key, or None: a later line replaces an earlier one."""
    matches = records.get(key)
    return matches[-1] if matches else None
