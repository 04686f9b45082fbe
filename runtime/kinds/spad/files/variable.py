"""Choice of the variable of a file that holds the counts, and the times that others state."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.runtime.kinds.spad.files.counts_file import KEYS, Hints
from camkit.runtime.kinds.spad.timing import TABLE_OF

MOST_LISTED: Final = 5

Shape = Sequence[int]


def chosen_name(
    path: Path,
    shapes: Mapping[str, Shape],
    hints: Hints,
    what: str = "arrays",
    others: Mapping[str, Shape] | None = None,
) -> str:
    """Return the variable to read.

    Args:
        path: The file, for errors.
        shapes: Of all variables that could be one.
        hints: The caller's choice.
        what: How the file calls them.
        others: Shapes of all that the file holds, for errors.

    Raises:
        ContractError: If the choice is none of them, or nobody chose among several.
        DecodeError: If there are none.
    """
    variables = sorted(shapes)
    if not variables:
        raise DecodeError(
            f"{path.name} holds no {what} of counts, histograms or time stamps: expected numbers "
            f"by rows and columns, or by time, rows and columns; it holds {_listed(others or {})}"
        )
    if hints.key is not None:
        if hints.key not in variables:
            raise ContractError(
                f"{path.name} holds no {hints.key!r} ([array] key); it holds {', '.join(variables)}"
            )
        return hints.key
    telling = [name for name in variables if name.rsplit("/", 1)[-1] in KEYS]
    candidates = telling or variables
    if len(candidates) > 1:
        raise ContractError(
            f"{path.name} holds several {what}: {', '.join(candidates)}; choose one by [array] key "
            f"in a file for {option_text('timing')}; their shapes are "
            f"{', '.join(str(tuple(shapes[name])) for name in candidates[:MOST_LISTED])}"
        )
    return candidates[0]


def _listed(shapes: Mapping[str, Shape]) -> str:
    """Return names with their shapes, as a text."""
    items = [f"{name} {tuple(shape)}" for name, shape in sorted(shapes.items())]
    more = f" and {len(items) - MOST_LISTED} more" if len(items) > MOST_LISTED else ""
    return (", ".join(items[:MOST_LISTED]) or "none") + more


def stated_values(values: Mapping[str, Any]) -> dict[str, object]:
    """Return what small values say of times, those of other names left out."""
    times: dict[str, object] = {}
    for name, value in values.items():
        if name not in TABLE_OF:
            continue
        plain = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        array = np.asarray(plain)
        if array.dtype.kind in "US":
            times[name] = str(array.ravel()[0]) if array.size == 1 else plain
        elif array.dtype.kind in "biuf":
            times[name] = array.ravel()[0].item() if array.size == 1 else array.ravel()
    return times
