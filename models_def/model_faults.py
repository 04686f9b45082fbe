"""Faults that pydantic finds in what people write, in camkit's own words."""

import re
from collections.abc import Collection, Mapping
from typing import Any, Final

from pydantic import ValidationError

MOST_SHOWN: Final = 60
"""Characters of a wrong value that a message shows."""
_WORDS: Final = {
    "missing": "is missing",
    "extra_forbidden": "is an unknown key",
    "float": "must be a number",
    "finite": "must be a finite number",
    "int": "must be a whole number",
    "string": "must be a text",
    "bool": "must be true or false",
    "tuple": "must be a list",
    "list": "must be a list",
    "model": "must be a table",
    "dict": "must be a table",
}
"""Kind of fault, or how it begins where it ends in "_type" or the like -> words."""
_OF_TYPES: Final = re.compile(r"(\w+?)_(type|parsing|from_float|attributes_type|number)")
_SHOULD: Final = re.compile(r"^[A-Z]\w+ should ")


def fault_texts(
    where: str, error: ValidationError, *, left_out: Collection[str] = ()
) -> tuple[str, ...]:
    """Return every fault as a line: the key, what was expected, what came.

    Args:
        where: Name of the table that was checked; empty for none.
        error: Of that table.
        left_out: Parts of places that the table does not spell out.
    """
    return tuple(_text(where, fault, left_out) for fault in error.errors(include_url=False))


def _text(where: str, fault: Mapping[str, Any], left_out: Collection[str]) -> str:
    key = where
    for part in fault["loc"]:
        if part not in left_out:
            key += f"[{part}]" if isinstance(part, int) else f".{part}" if key else str(part)
    kind, value = fault["type"], f"{fault['input']!r:.{MOST_SHOWN}}"
    if kind in ("value_error", "assertion_error"):
        return f"{key}: {fault['ctx']['error']}"
    if kind == "union_tag_invalid":
        context = fault["ctx"]
        name = context["discriminator"].strip("'")
        return f"{key}.{name} must be one of {context['expected_tags']}; got {context['tag']!r}"
    of_types = _OF_TYPES.fullmatch(kind)
    words = _WORDS.get(kind) or (of_types and _WORDS.get(of_types[1]))
    text = f"{key} {words or _SHOULD.sub('must ', fault['msg'])}"
    return text if kind in ("missing", "extra_forbidden") else f"{text}; got {value}"
