"""The result of a calibration as TOML that reads back to the same values."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from camkit.errors import ContractError

_BARE_KEY: Final = re.compile(r"[A-Za-z0-9_-]+")
_LONGEST_LINE: Final = 100
_ESCAPES: Final = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t"}


def to_toml(record: Mapping[str, Any]) -> str:
    """Return the TOML text of a record: `tomllib.loads` returns the record without unknown values.

    Args:
        record: Texts as keys; values are bool, int, float, str, lists (or tuples) of those and of
            such lists, mappings, and lists of mappings. A tuple reads back as a list. A key whose
            value is None is left out: TOML has no null.

    Raises:
        ContractError: If a number is not finite, or a value is of another kind.
    """
    lines: list[str] = []
    _add_table(lines, record, ())
    return "\n".join(lines) + "\n"


def _add_table(lines: list[str], table: Mapping[str, Any], path: tuple[str, ...]) -> None:
    """Add the values of a table, then the tables in it, each under its own heading."""
    nested = []
    for key, value in table.items():
        if not isinstance(key, str):
            raise ContractError(f"keys of a record are texts; got {key!r}")
        if value is None:
            continue
        if isinstance(value, Mapping) or _is_tables(value):
            nested.append((key, value))
        else:
            name = ".".join((*path, key))
            lines.append(f"{_key(key, name)} = {_value(value, name)}")
    for key, value in nested:
        inner = (*path, key)
        heading = ".".join(_key(part, ".".join(inner)) for part in inner)
        single = isinstance(value, Mapping)
        for one in (value,) if single else value:
            lines += [""] if lines else []
            lines.append(f"[{heading}]" if single else f"[[{heading}]]")
            _add_table(lines, one, inner)


def _is_tables(value: Any) -> bool:
    return _is_list(value) and bool(value) and all(isinstance(one, Mapping) for one in value)


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _key(key: str, name: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else _text(key, name)


def _value(value: Any, name: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return int.__repr__(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ContractError(f"{name} of a record must be finite; got {value}")
        return float.__repr__(value)
    if isinstance(value, str):
        return _text(value, name)
    if _is_list(value):
        return _list(value, name)
    raise ContractError(
        f"{name} of a record must be bool, int, float, str, a list or a mapping; got "
        f"{type(value).__name__}; leave out what is not known"
    )


def _list(values: Sequence[Any], name: str) -> str:
    """Return a list on one line, or one member a line where it is long or holds lists."""
    members = [_value(value, name) for value in values]
    line = f"[{', '.join(members)}]"
    rows = any(_is_list(value) for value in values)
    if not rows and len(line) + len(name) <= _LONGEST_LINE:
        return line
    return "[\n" + "".join(f"    {member},\n" for member in members) + "]"


def _text(text: str, name: str) -> str:
    if any("\ud800" <= letter <= "\udfff" for letter in text):
        raise ContractError(f"{name} of a record is no text that UTF-8 can hold; got {text!a}")
    return '"' + "".join(_ESCAPES.get(letter, _escaped(letter)) for letter in text) + '"'


def _escaped(letter: str) -> str:
    control = letter < " " or letter == "\x7f"
    return f"\\u{ord(letter):04x}" if control else letter
