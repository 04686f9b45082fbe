"""The one way to a terminal: texts of files, bundles and errors lose what would steer it."""

import re
from typing import Final

import typer

_STEERING: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""Control characters but tab and newline, what turns the direction of text, lone surrogates."""


def plain(text: str) -> str:
    """Give a text with its control characters as visible escapes."""
    return _STEERING.sub(lambda found: ascii(found[0])[1:-1], text)


def say(text: str, *, err: bool = False) -> None:
    """Print a text of any origin, on stdout or stderr."""
    typer.echo(plain(text), err=err)


def say_over(text: str, *, last: bool = False) -> None:
    """Print a line on stderr over the one before it, for progress on a terminal."""
    typer.echo(f"\r\033[K{plain(text)}", err=True, nl=last)
