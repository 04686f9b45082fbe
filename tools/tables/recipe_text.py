"""Recipes as text: a table's key with another value, as a person would have edited it."""

import tomllib
from collections.abc import Mapping, Sequence

from camkit.errors import ContractError
from camkit.models_def.toml_table import key_line

Value = str | float | bool | Sequence[str | float]


def with_keys(text: str, table: str, keys: Mapping[str, Value]) -> str:
    """Return the text of a recipe with other values of keys of a table, each on a line of its own.

    Raises:
        ContractError: If there is no such table, or the values do not come out.
    """
    lines, inside, is_there = [], False, False
    for line in text.splitlines():
        if line.startswith("["):
            inside = line.strip() == f"[{table}]"
        if not (inside and line.split("=")[0].strip() in keys):
            lines.append(line)
        if inside and line.startswith("["):
            is_there = True
            lines += [key_line(key, value) for key, value in keys.items()]
    changed = "\n".join(lines) + "\n"
    if not is_there:
        raise ContractError(f"the recipe has no table [{table}]")
    try:
        values = tomllib.loads(changed)[table]
    except tomllib.TOMLDecodeError as error:
        raise ContractError(f"[{table}] holds one of {', '.join(keys)} on many lines") from error
    if any(values[key] != value for key, value in keys.items()):
        raise ContractError(f"[{table}] holds one of {', '.join(keys)} twice")
    return changed
