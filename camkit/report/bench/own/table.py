"""Rows of a kind that measures itself as text: a table for every sort of row."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

SORT: Final = "sort"
"""Column that says which sort a row is of."""
Row = Mapping[str, Any]


def own_lines(rows: Iterable[Row]) -> list[str]:
    """Return the lines of all tables; columns without any value are left out."""
    sorts: dict[Any, list[Row]] = {}
    for row in rows:
        sorts.setdefault(row.get(SORT), []).append(row)
    lines: list[str] = []
    for name, own in sorts.items():
        lines += [*([""] if lines else []), *([] if name is None else [str(name)]), *_table(own)]
    return lines


def _table(rows: list[Row]) -> list[str]:
    keys = dict.fromkeys(key for row in rows for key in row if key != SORT)
    shown = [key for key in keys if any(row.get(key) is not None for row in rows)]
    cells = [shown, *([_cell(row.get(key)) for key in shown] for row in rows)]
    widths = [max(len(line[i]) for line in cells) for i in range(len(shown))]
    return [
        "  ".join(w.ljust(n) for w, n in zip(line, widths, strict=True)).rstrip() for line in cells
    ]


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)
