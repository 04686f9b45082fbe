"""Results as they are kept and shown: compact JSON, tables in Markdown."""

import json
from collections.abc import Iterable, Sequence
from typing import Any


def to_compact_json(value: Any, digits: int) -> str:
    """Return one line of JSON without blank space; floats keep so many significant digits.

    Args:
        value: Plain values, lists and objects.
        digits: Significant digits; whole numbers of type int keep all of theirs.
    """
    return json.dumps(_rounded(value, digits), separators=(",", ":"))


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown, a line for each row."""
    lines = [f"| {' | '.join(cells)} |" for cells in (heads, *rows)]
    return "\n".join([lines[0], "|---" * len(heads) + "|", *lines[1:]])


def left_out_lines(record: dict[str, Any]) -> list[str]:
    """Return a line for everything that a record says is left out, and why."""
    pairs = [pair for key in record if key.endswith("left_out") for pair in record[key].items()]
    return [f"- {name} is left out: {reason}" for name, reason in pairs]


def _rounded(value: Any, digits: int) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{digits}g}")
    if isinstance(value, dict):
        return {key: _rounded(entry, digits) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(entry, digits) for entry in value]
    return value
