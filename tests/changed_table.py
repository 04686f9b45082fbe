"""A recipe changed at some of its keys."""

import tomllib
from typing import Any

Table = dict[str, Any]


def changed_table(text: str, **changes: Any) -> Table:
    """Give the table of a recipe, changed at keys such as data__scene_px; None takes one out."""
    table = tomllib.loads(text)
    for dotted, value in changes.items():
        *path, last = dotted.split("__")
        place = table
        for part in path:
            place = place.setdefault(part, {})
        if value is None:
            del place[last]
        else:
            place[last] = value
    return table
