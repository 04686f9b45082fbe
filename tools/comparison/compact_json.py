"""JSON of results that are kept: no blank space, numbers of as many digits as they are worth."""

import json
from typing import Any


def to_compact_json(value: Any, digits: int) -> str:
    """Return one line of JSON; every float keeps so many significant digits.

    Args:
        value: Plain values, lists and objects.
        digits: Significant digits; whole numbers of type int keep all of theirs.
    """
    return json.dumps(_rounded(value, digits), separators=(",", ":"))


def _rounded(value: Any, digits: int) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{digits}g}")
    if isinstance(value, dict):
        return {key: _rounded(entry, digits) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(entry, digits) for entry in value]
    return value
