"""The multi-configuration lines of a .zmx file: OPERAND NUMBER CONFIGURATION VALUE ....

Each configuration becomes a file of its own, in which the lines of the system and of the surfaces
have its values.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError, UnsupportedError
from camkit.models_def.optics.lens_file.zmx_completion import SIZED_APERTURES
from camkit.models_def.optics.lens_file.zmx_records import Record, Records, ZmxRecords, last

MAX_STATES: Final = 100
_SURFACE_KEYS: Final = {"THIC": "DISZ", "SDIA": "DIAM"}
_FIELD_KEYS: Final = {"XFIE": ("XFLN", "XFLD"), "YFIE": ("YFLN", "YFLD")}
_ELSEWHERE: Final = "WAVE"
"""A line of old files too, where it stands before MNUM."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZmxStates:
    """The configurations of a file.

    Attributes:
        current: Number of the one that the rest of the file shows.
        files: Number -> the file in that configuration; empty where nothing differs that camkit
            carries.
        notes: What differs and is left out.
    """

    current: str
    files: Mapping[str, ZmxRecords]
    notes: tuple[str, ...]

    def number(self, choice: str | int | None) -> str:
        """Return the number of a configuration, the current one where none is chosen.

        Raises:
            ContractError: If there is no such configuration.
        """
        number = self.current if choice is None else str(choice)
        if choice is not None and number not in self.files:
            names = f"one of {', '.join(self.files)}" if self.files else "for files that have some"
            raise ContractError(f"{option_text('configuration')} is {names}; got {choice!r}")
        return number


def split_states(records: ZmxRecords) -> tuple[ZmxRecords, ZmxStates]:
    """Return a file without its multi-configuration lines, and its configurations.

    Raises:
        DecodeError: If a line names a surface, field or configuration that is not there.
        UnsupportedError: If there are more than `MAX_STATES` configurations.
    """
    head = last(records.system, "MNUM")
    if head is None:
        return records, ZmxStates(current="1", files={}, notes=())
    count, current = int(head.number(0, 1.0)), int(head.number(1, 1.0))
    plain, operands = _without_operands(records, head.line)
    if count <= 1:
        return plain, ZmxStates(current="1", files={}, notes=())
    if count > MAX_STATES:
        raise UnsupportedError(
            f"line {head.line}: {count} configurations; camkit reads up to {MAX_STATES}"
        )
    if not 1 <= current <= count:
        raise DecodeError(f"line {head.line}: MNUM shows configuration {current} of {count}")
    readable = [record for record in operands if _is_carried(plain, record)]
    notes = _notes(head, [r for r in operands if r not in readable], current)
    if not readable:
        note = f"line {head.line}: {count} configurations: the one shown is read"
        return plain, ZmxStates(current=str(current), files={}, notes=(note, *notes))
    files = {str(number): plain for number in range(1, count + 1)}
    for record in readable:
        number = _whole(record, 1)
        if not 1 <= number <= count:
            raise DecodeError(f"line {record.line}: {record.key} of configuration {number}")
        if number != current:
            files[str(number)] = _changed(files[str(number)], record)
    return plain, ZmxStates(current=str(current), files=files, notes=notes)


def _without_operands(records: ZmxRecords, line: int) -> tuple[ZmxRecords, list[Record]]:
    """Return the file without the lines behind MNUM that would mean something else, and all."""
    operands = [
        record
        for entries in records.system.values()
        for record in entries
        if record.line > line and len(record.words) > 2 and record.words[1].isdecimal()
    ]
    waves = [record for record in records.system.get(_ELSEWHERE, []) if record not in operands]
    system = {key: entries for key, entries in records.system.items() if key != _ELSEWHERE}
    if waves:
        system[_ELSEWHERE] = waves
    return replace(records, system=system), sorted(operands, key=lambda record: record.line)


def _is_carried(records: ZmxRecords, record: Record) -> bool:
    if record.key == "APER":
        return any(key in records.system for key in SIZED_APERTURES)
    return record.key in _SURFACE_KEYS or record.key in _FIELD_KEYS


def _notes(head: Record, records: list[Record], current: int) -> tuple[str, ...]:
    """Return a note of what differs between configurations and is left out."""
    values: dict[tuple[str, str], set[str]] = {}
    for record in records:
        values.setdefault((record.key, record.words[0]), set()).add(record.words[2])
    keys = sorted({key for (key, _), entries in values.items() if len(entries) > 1})
    if not keys:
        return ()
    return (
        f"line {head.line}: {', '.join(keys)} of the configurations left out: they are as in "
        f"configuration {current}",
    )


def _changed(records: ZmxRecords, record: Record) -> ZmxRecords:
    """Return the file with the value of one operand."""
    if record.key in _SURFACE_KEYS:
        number = _whole(record, 0)
        image = len(records.surfaces) - 1
        if number == image:  # nothing lies behind it
            return records
        if not 0 <= number < image:
            raise DecodeError(f"line {record.line}: {record.key} of surface {number}")
        blocks = list(records.surfaces)
        blocks[number] = _with_value(blocks[number], _SURFACE_KEYS[record.key], 0, record)
        return replace(records, surfaces=tuple(blocks))
    if record.key == "APER":
        key = next(_present(records.system, SIZED_APERTURES))
        return replace(records, system=_with_value(records.system, key, 0, record))
    kinds = _FIELD_KEYS[record.key]
    key = next(_present(records.system, kinds), kinds[0])
    place = _whole(record, 0) - 1
    if not 0 <= place <= len(records.system[key][-1].words if key in records.system else ()):
        raise DecodeError(f"line {record.line}: {record.key} of field {place + 1}")
    return replace(records, system=_with_value(records.system, key, place, record))


def _present(system: Records, keys: tuple[str, ...]) -> Iterator[str]:
    return (key for key in keys if key in system)


def _with_value(records: Records, key: str, place: int, operand: Record) -> Records:
    """Return records with one word of the last record of a key replaced by that of an operand."""
    old = last(records, key) or replace(operand, key=key, words=(), text="")
    value = repr(operand.number(2))
    words = (*old.words[:place], value, *old.words[place + 1 :])
    return {**records, key: [replace(old, words=words, text=" ".join(words))]}


def _whole(record: Record, place: int) -> int:
    value = record.number(place)
    if value != int(value):
        raise DecodeError(f"line {record.line}: {record.key} needs whole numbers; got {value:g}")
    return int(value)
