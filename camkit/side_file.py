"""Side files (timing, unit, scene, plate, lens, PSF): regular, of bounded size, of bounded depth.

What is no regular file is refused before it is opened, so no pipe hangs and no device fills the
memory.
"""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from camkit.errors import ContractError, DecodeError
from camkit.regular_file import check_regular

MOST_BYTES: Final = 256_000_000
"""Of any side file."""
MOST_TEXT_BYTES: Final = 4_000_000
"""Of text that people write."""
MOST_DEPTH: Final = 32
"""Of tables and lists in one another."""
_KEY_PART: Final = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*"""
_DEEP_KEY: Final = re.compile(rf"(?:^|[\[{{,])[ \t]*(?:{_KEY_PART}){{{MOST_DEPTH}}}", re.MULTILINE)
"""Dotted keys take tomllib a time that grows with the square of their depth."""


def read_side_bytes(path: Path, what: str, *, most_bytes: int = MOST_BYTES) -> bytes:
    """Read a side file whole.

    Args:
        path: The file.
        what: What it holds, for errors.
        most_bytes: What such a file may have.

    Raises:
        ContractError: If it cannot be read, is no regular file, or is larger.
    """
    try:
        check_regular(path)
        with path.open("rb") as file:
            data = file.read(most_bytes + 1)
    except OSError as error:
        raise ContractError(f"cannot read {what} {path}: {error.strerror or error}") from error
    except (DecodeError, ValueError) as error:
        raise ContractError(f"cannot read {what} {path}: {error}") from error
    if len(data) > most_bytes:
        raise ContractError(
            f"{what} {path} has more than {most_bytes / 1e6:g} MB; such a file has at most that"
        )
    return data


def read_side_text(path: Path, what: str, *, most_bytes: int = MOST_TEXT_BYTES) -> str:
    """Read a side file of UTF-8 text; arguments and errors as of `read_side_bytes`."""
    try:
        return read_side_bytes(path, what, most_bytes=most_bytes).decode("utf-8")
    except UnicodeDecodeError as error:
        raise ContractError(f"{what} {path} is no UTF-8 text: {error.reason}") from error


def read_side_toml(path: Path, what: str) -> dict[str, Any]:
    """Read a side file of TOML.

    Raises:
        ContractError: As `read_side_bytes`; if it is no TOML, or is nested too deep.
    """
    data = read_side_bytes(path, what, most_bytes=MOST_TEXT_BYTES)
    return parse_toml(data, f"{what} {path}")


def parse_toml(data: bytes, what: str) -> dict[str, Any]:
    """Parse TOML.

    Args:
        data: UTF-8.
        what: What it is, for errors.

    Raises:
        ContractError: If it is no TOML, or is nested deeper than `MOST_DEPTH`.
    """
    too_deep = f"{what} is nested too deep; expected at most {MOST_DEPTH} levels"
    try:
        text = data.decode("utf-8")
        tables = None if _DEEP_KEY.search(text) else tomllib.loads(text)
    except RecursionError as error:
        raise ContractError(too_deep) from error
    except ValueError as error:  # also of numbers that are no dates, or have thousands of digits
        raise ContractError(f"{what} is not valid TOML: {error}") from error
    if tables is None or _is_deeper(tables, MOST_DEPTH):
        raise ContractError(too_deep)
    return tables


def _is_deeper(value: object, depth: int) -> bool:
    """Return whether tables and lists lie more than `depth` deep in one another."""
    level = [value]
    for _ in range(depth + 1):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, Mapping) else outer)  # type: ignore[attr-defined]
            if isinstance(inner, Mapping | list)
        ]
        if not level:
            return False
    return True
