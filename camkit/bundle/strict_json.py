"""JSON that every reader understands alike: no key twice, no endless nesting.

NaN and infinities are let through: the schema refuses them, naming the field.
"""

import json
from collections.abc import Sequence
from typing import Any

from camkit.errors import BundleError


class _TwiceError(ValueError):
    """A key that occurs twice in one object."""


def read_json(data: bytes, *, what: str) -> Any:
    """Decode JSON strictly.

    Args:
        data: UTF-8 text.
        what: Its name in the error message.

    Raises:
        BundleError: If it is no JSON, holds a key twice in one object or a number of
            thousands of digits, or is nested too deep.
    """
    try:
        return json.loads(data.decode("utf-8"), object_pairs_hook=_object)
    except _TwiceError as error:
        raise BundleError(
            f"{what} holds the key {error} twice in one object, which readers take differently; "
            "export it again"
        ) from error
    except RecursionError as error:
        raise BundleError(
            f"{what} cannot be read: it is nested too deep; export it again"
        ) from error
    except ValueError as error:
        raise BundleError(
            f"{what} cannot be read: it is no JSON ({error}); export it again"
        ) from error


def _object(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    table: dict[str, Any] = {}
    for key, value in pairs:
        if key in table:
            raise _TwiceError(repr(key[:80]))
        table[key] = value
    return table
