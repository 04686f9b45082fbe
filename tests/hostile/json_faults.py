"""Faults of a JSON document: odd values, keys left out, put in, twice or moved, deep nesting."""

import json
from typing import Any

from tests.hostile.decisions import Decisions

ODD_VALUES: tuple[Any, ...] = (
    *(None, True, False, "", "x", "\u0000", "\ud800", "é" * 40, "a" * 5000, "..", "1e309"),
    *(0, 1, -1, 2, 3, 7, 16, 17, 255, 256, 1000, 4096, 8192, 65535, 65536, 2**31, 2**53, 2**64),
    *(10**12, -(10**12), 10**30, 10**400),
    *(0.5, -0.5, 1e-300, 5e-324, 1e-12, 1e12, 1e38, 1e300, 1e308, -1e308),
    *(float("nan"), float("inf"), float("-inf")),
    *([], {}, [[]], [None], [1, 2], [0] * 300, {"a": {}}, [[[[[[[[1]]]]]]]]),
)
_FACTORS = (0.0, -1.0, 0.5, 2.0, 3.0, 10.0, 100.0, 1e3, 1e6, 1e12, 1e-3, 1e-9)


def changed_json(document: dict[str, Any], choose: Decisions) -> bytes:
    """Give the text of a changed copy."""
    made: Any = json.loads(json.dumps(document))
    for _ in range(1 + choose.index(3)):
        _change(made, choose)
    text = json.dumps(made, ensure_ascii=choose.coin())
    match choose.index(12):
        case 1:
            text = _with_key_twice(text, choose)
        case 2:
            text = text.replace(":", ': {"deep": ' + "[" * 20_000, 1)
        case 3:
            at = choose.index(len(text) + 1)
            text = text[:at] + choose.pick(("{", "]", '"', "9" * 5000, "//", "NaN", "")) + text[at:]
        case _:
            pass
    return text.encode("utf-8", errors="surrogatepass")


def _places(node: Any) -> list[tuple[Any, Any]]:
    """Give (container, key) of every value of a document."""
    found: list[tuple[Any, Any]] = []
    keys = node.keys() if isinstance(node, dict) else range(len(node))
    for key in keys:
        found.append((node, key))
        if isinstance(node[key], dict | list):
            found += _places(node[key])
    return found


def _change(document: Any, choose: Decisions) -> None:
    places = _places(document)
    if not places:
        return
    holder, key = choose.pick(places)
    old = holder[key]
    match choose.index(8):
        case 0:
            del holder[key]
        case 1:
            other = choose.pick(places)
            holder[key] = (
                json.loads(json.dumps(other[0].get(other[1], 1)))
                if isinstance(other[0], dict)
                else 1
            )
        case 2 if isinstance(holder, dict):
            holder[choose.pick(("x", "type", "name", "é", "", "takes", "role"))] = old
        case 3 if isinstance(holder, list):
            holder.insert(key, json.loads(json.dumps(old)))
        case 4 | 5 | 6 if isinstance(old, int | float) and not isinstance(old, bool):
            scaled = old * choose.pick(_FACTORS)
            keeps = isinstance(old, int) and abs(scaled) < 1e30
            holder[key] = round(scaled) if keeps else scaled
        case _:
            holder[key] = choose.pick(ODD_VALUES)


def _with_key_twice(text: str, choose: Decisions) -> str:
    """Put an entry twice into the first object, the same or another."""
    entry = choose.pick(('"name": "tiny"', '"members": {}', '"format_version": "2.0"', '"a": 1'))
    return text.replace("{", "{" + entry + ", " + entry + ", ", 1)
