"""TOML tables turned into dataclasses; unknown, missing and wrong keys are errors naming them.

All faults of a table are named at once.
"""

import difflib
import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, fields
from itertools import chain
from types import NoneType, UnionType
from typing import Any, Final, Literal, ParamSpec, TypeVar, get_args, get_origin, get_type_hints

from camkit.errors import ContractError, UnsupportedError

MOST_LISTED: Final = 6
"""Keys that a message lists: the nearest ones where there are more."""
TYPE_NAMES: Final[Mapping[Any, str]] = {
    str: "a text",
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    list: "a list",
    dict: "a table",
    Mapping: "a table",
}

T = TypeVar("T")
P = ParamSpec("P")


class Faults:
    """Faults of a file, gathered part by part and raised together."""

    def __init__(self) -> None:
        self._texts: list[str] = []

    def read(self, reader: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Return what a reader returns; a part that it refuses counts, and gives None.

        What is read after a fault is only used to find further ones: call `refuse` before it is.
        """
        try:
            return reader(*args, **kwargs)
        except ContractError as error:
            self._texts.append(str(error))
            return None  # type: ignore[return-value]

    def refuse(self) -> None:
        """Refuse the file if there was a fault.

        Raises:
            ContractError: Naming all of them.
        """
        if self._texts:
            raise ContractError("; ".join(dict.fromkeys(self._texts)))


@contextmanager
def faults_of(what: str) -> Iterator[None]:
    """Raise the faults of this block with the name of a file before them.

    Raises:
        ContractError: A fault with the file before it; an UnsupportedError likewise.
    """
    try:
        yield
    except ContractError as error:
        raise ContractError(f"{what}: {error}") from error
    except UnsupportedError as error:
        raise UnsupportedError(f"{what}: {error}") from error


def section(where: str, kind: type[T], table: Any) -> T:
    """Make a dataclass of a table, key by key.

    Raises:
        ContractError: If a key is unknown, missing or of a wrong type, or a value is refused.
    """
    if not isinstance(table, Mapping):
        raise ContractError(f"{where} must be a table; got {table!r}")
    hints = get_type_hints(kind)
    faults = Faults()
    faults.read(check_keys, where, table, set(hints))
    required = {f.name for f in fields(kind) if _is_required(f)}  # type: ignore[arg-type]
    faults.read(_check_missing, where, required - set(table))
    values = {
        key: faults.read(typed, f"{where}.{key}", value, hints[key])
        for key, value in table.items()
        if key in hints
    }
    faults.refuse()
    return kind(**values)


def check_keys(where: str, table: Mapping[str, Any], keys: set[str]) -> None:
    """Refuse keys that are not known."""
    unknown = sorted(set(table) - keys)
    if unknown:
        names = ", ".join(map(repr, unknown))
        choices = sorted(keys)
        if len(choices) > MOST_LISTED:
            near = (difflib.get_close_matches(name, choices, MOST_LISTED, 0.0) for name in unknown)
            choices = list(dict.fromkeys(chain.from_iterable(zip(*near, strict=True))))[
                :MOST_LISTED
            ]
        raise ContractError(
            f"{where}: unknown key{'s' * (len(unknown) > 1)} {names}; known are "
            f"{', '.join(choices)}{' and others' * (len(choices) < len(keys))}"
        )


def _check_missing(where: str, missing: set[str]) -> None:
    if missing:
        raise ContractError(f"{where} lacks {', '.join(sorted(missing))}")


def typed(where: str, value: Any, kind: Any) -> Any:
    """Return a value as the type of its field; whole numbers pass as float, lists as tuples.

    Raises:
        ContractError: If it is of another type, or None: TOML has none, so the key is missing.
    """
    if value is None:
        raise ContractError(f"{where} is missing")
    if get_origin(kind) is UnionType:  # TOML has no None: a key that is there has a value
        (kind,) = (one for one in get_args(kind) if one is not NoneType)
    if get_origin(kind) is tuple:
        if not isinstance(value, list):
            raise ContractError(f"{where} must be a list; got {value!r}")
        inner = get_args(kind)[0]
        return tuple(typed(f"{where}[{i}]", v, inner) for i, v in enumerate(value))
    if get_origin(kind) is Literal:
        if value not in get_args(kind):
            choices = ", ".join(map(str, get_args(kind)))
            raise ContractError(f"{where} must be one of {choices}; got {value!r}")
        return value
    kind = get_origin(kind) or kind
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if isinstance(value, float) and math.isnan(value):
        raise ContractError(f"{where} must be a number; got nan")
    if not isinstance(value, kind) or isinstance(value, bool) != (kind is bool):
        raise ContractError(f"{where} must be {TYPE_NAMES.get(kind, kind.__name__)}; got {value!r}")
    return value


def check_least(table: Any, least: float, *names: str) -> None:
    """Refuse attributes of a dataclass that are below the least value.

    Raises:
        ContractError: Naming the first one.
    """
    for name in names:
        if not (value := getattr(table, name)) >= least:
            raise ContractError(f"{name} must be >= {least:g}; got {value}")


def table_digest(table: Mapping[str, Any]) -> str:
    """Return the sha256 of plain values, whatever the order of their keys."""
    return hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()


def key_line(key: str, value: str | float | bool | Sequence[str | float]) -> str:
    """Return a line of TOML; numbers to their last bit."""
    return f"{key} = {_value_text(value)}"


def _value_text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # every control character is escaped, as TOML wants it
        escaped = "".join(
            f"\\u{ord(c):04x}" if ord(c) < 32 or ord(c) == 127 else c
            for c in value.replace("\\", "\\\\").replace('"', '\\"')
        )
        return f'"{escaped}"'
    if isinstance(value, Sequence):
        return f"[{', '.join(map(_value_text, value))}]"
    return repr(value)


def _is_required(entry: Any) -> bool:
    return entry.default is MISSING and entry.default_factory is MISSING
