"""Tables of a recipe as text, every key with its default and what it is.

What a key is comes from the docstring of the dataclass or model that reads it, so that file and
code cannot disagree.
"""

import inspect
import re
import textwrap
from collections.abc import Collection, Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, Final

from pydantic import BaseModel

from camkit.models_def.toml_table import key_line

WIDTH: Final = 96
_ENTRY: Final = re.compile(r"^ {4}(\w+): (.*)$")


def table_lines(
    name: str, kind: type, values: Mapping[str, Any], *, left_out: Collection[str] = ()
) -> list[str]:
    """Return a table: the given values and the defaults of all other keys, each with a comment.

    Tables within it, and keys that are left out by default, are left out.

    Args:
        name: Of the table.
        kind: The dataclass or pydantic model that reads it.
        values: Key -> value.
        left_out: Keys that no recipe states.
    """
    notes = attribute_notes(kind)
    lines = [f"[{name}]"]
    for key, default in _defaults(kind).items():
        value = values.get(key, default)
        if key not in left_out and _is_plain(value):
            comment = textwrap.wrap(notes.get(key, ""), WIDTH)
            lines += [*(f"# {line}" for line in comment), key_line(key, value)]
    return [*lines, ""]


def attribute_notes(kind: type) -> dict[str, str]:
    """Return what the docstrings of a class and its bases say of their attributes."""
    notes: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        text = inspect.getdoc(base) if "__doc__" in vars(base) else None
        key = ""
        for line in (text or "").partition("Attributes:\n")[2].splitlines():
            entry = _ENTRY.match(line)
            if entry is not None:
                key, notes[entry[1]] = entry[1], entry[2]
            elif key and line.startswith(" " * 8):
                notes[key] += " " + line.strip()
            else:
                key = ""
    return notes


def _defaults(kind: type) -> dict[str, Any]:
    """Return the keys of a table and their defaults; None where there is none."""
    if is_dataclass(kind):
        return {f.name: None if f.default is MISSING else f.default for f in fields(kind)}
    if issubclass(kind, BaseModel):
        return {
            name: None if entry.is_required() else entry.default
            for name, entry in kind.model_fields.items()
        }
    raise TypeError(f"{kind.__name__} is neither a dataclass nor a model")


def _is_plain(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return bool(value) and all(map(_is_plain, value))
    return isinstance(value, str | bool | int | float)
