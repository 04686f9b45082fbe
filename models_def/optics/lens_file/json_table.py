"""Values of lens files in JSON: tables, lists and numbers, or an error that names the place."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from camkit.errors import DecodeError
from camkit.models_def.optics.glass.encoding import read_text

MAX_SURFACES: Final = 1000
MAX_NUMBER: Final = 1e100

Table = Mapping[str, Any]


def read_json_table(path: Path) -> Table:
    """Read a file that holds one JSON object.

    Raises:
        DecodeError: If it is no JSON, or no object.
    """
    try:
        value = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise DecodeError(f"{path.name} is damaged: JSON was expected; {error}") from error
    if not isinstance(value, dict):
        raise DecodeError(f"{path.name} must hold a JSON object; got {type(value).__name__}")
    return value


def table_at(table: Table, key: str, where: str) -> Table:
    """Return the table of a key; an empty one where there is none."""
    value = table.get(key)
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise DecodeError(f"{where}: {key} must be an object; got {type(value).__name__}")
    return value


def tables_at(table: Table, key: str, where: str) -> tuple[Table, ...]:
    """Return the list of tables of a key; an empty one where there is none."""
    values = table.get(key)
    if values is None:
        return ()
    if not isinstance(values, list) or not all(isinstance(v, dict) for v in values):
        raise DecodeError(f"{where}: {key} must be a list of objects")
    if len(values) > MAX_SURFACES:
        raise DecodeError(f"{where}: more than {MAX_SURFACES} entries in {key}")
    return tuple(values)


def text_at(table: Table, key: str) -> str:
    """Return the text of a key; an empty one where there is none."""
    value = table.get(key)
    return value if isinstance(value, str) else ""


def number_at(table: Table, key: str, where: str, default: float | None = None) -> float:
    """Return the number of a key; inf for an infinite one.

    Raises:
        DecodeError: If it is missing without default, or no number.
    """
    value = table.get(key)
    return default if value is None and default is not None else _number(value, key, where)


def finite_at(table: Table, key: str, where: str, default: float | None = None) -> float:
    """Return the number of a key, which must be finite; see `number_at`."""
    value = number_at(table, key, where, default)
    if not math.isfinite(value):
        raise DecodeError(f"{where}: {key} must be finite; got {value}")
    return value


def numbers_at(table: Table, key: str, where: str) -> tuple[float, ...]:
    """Return the list of finite numbers of a key; an empty one where there is none."""
    values = table.get(key)
    if values is None:
        return ()
    if not isinstance(values, list):
        raise DecodeError(f"{where}: {key} must be a list of numbers")
    numbers = tuple(_number(value, key, where) for value in values)
    if not all(map(math.isfinite, numbers)):
        raise DecodeError(f"{where}: {key} must hold finite numbers; got {values}"[:200])
    return numbers


def _number(value: object, key: str, where: str) -> float:
    # programs write a number of one element as a list
    if isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 1:
        value = value[0]
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not (abs(value) <= MAX_NUMBER or math.isinf(value)):  # type: ignore[arg-type]
        raise DecodeError(f"{where}: {key} must be a number; got {str(value)[:40]!r}")
    return float(value)  # type: ignore[arg-type]
