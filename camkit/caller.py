"""The language of the caller: a flag on the command line, a parameter in a program.

Messages name an option by what it is called in Python and are spoken where they are raised:

    option_text("max_mem_bytes")          --max-mem           max_mem_bytes
    option_text("on_unsafe", "warn")      --on-unsafe warn    on_unsafe="warn"

Programs are spoken to unless somebody says otherwise: the command line says so for its process and
its children, a cluster for the task of one caller.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from enum import Enum
from typing import Final, Literal, cast, get_args

Language = Literal["python", "command"]
VARIABLE: Final = "CAMKIT_LANGUAGE"
"""In the environment, which children inherit and threads share."""

FLAGS: Final = {
    "white_balance": "--wb",
    "exposure_ev": "--exposure",
    "max_mem_bytes": "--max-mem",
    "cfa": "--mosaic",
    "times_s": "--times",
    "darks": "--dark",
    "flats": "--flat",
    "photo": "--from",
    "before_file": "--before",
    "crops": "--crop",
}
"""Options whose flag is not their name."""
PARAMETERS: Final = {
    "cfa": "MosaicOptions.cfa",
    "black_level": "MosaicOptions.black_level",
    "white_level": "MosaicOptions.white_level",
}
"""Options that are fields of a parameter."""


class _Missing(Enum):
    VALUE = 0


_task: ContextVar[Language | None] = ContextVar("camkit_language", default=None)


def language() -> Language:
    """Return the language of the caller."""
    name = _task.get() or os.environ.get(VARIABLE)
    return cast("Language", name) if name in get_args(Language) else "python"


@contextmanager
def speaking(name: Language) -> Iterator[None]:
    """Set the language of this process and of the children that it starts."""
    previous = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = name
    try:
        yield
    finally:
        if previous is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = previous


@contextmanager
def speaking_here(name: Language) -> Iterator[None]:
    """Set the language of this thread alone, whose process serves several callers."""
    token = _task.set(name)
    try:
        yield
    finally:
        _task.reset(token)


def option_text(name: str, value: object = _Missing.VALUE) -> str:
    """Return an option as the caller writes it.

    Args:
        name: Its name in Python.
        value: What to choose; none names the option alone.
    """
    if language() == "command":
        return _flag(name, value)
    parameter = PARAMETERS.get(name, name)
    if value is _Missing.VALUE:
        return parameter
    if isinstance(value, str):
        return f'{parameter}="{value}"'
    return f"{parameter}={_plain(value)}"


def command_text(name: str) -> str:
    """Return a command as the caller writes it: `camkit freeze`, or `camkit.freeze`."""
    return f"camkit {name}" if language() == "command" else f"camkit.{name}"


def option_list(names: list[str]) -> str:
    """Return several options as the caller writes them."""
    return ", ".join(map(option_text, names))


def _flag(name: str, value: object) -> str:
    flag = FLAGS.get(name, "--" + name.replace("_", "-"))
    if value is False:
        return flag.replace("--", "--no-", 1)
    if value is _Missing.VALUE or value is True:
        return flag
    if name == "max_mem_bytes" and isinstance(value, int):
        return f"{flag} {value // 10**6 + 1}M"
    if isinstance(value, tuple):
        return f"{flag} {','.join(map(_plain, value))}"
    return f"{flag} {_plain(value)}"


def _plain(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    is_large = type(value) is int and value >= 10**6
    return f"{value:_}" if is_large else str(value)
