"""Groups of commands in the help, by what a person wants, and how a command joins one."""

from collections.abc import Callable
from typing import Any, Final

import typer

USE: Final = "Use a camera"
JUDGE: Final = "Judge a camera"
MAKE: Final = "Make a camera (needs torch)"
MEASURE: Final = "Measure a camera"


def add_command(
    app: typer.Typer,
    command: Callable[..., None],
    group: str,
    summary: str,
    *,
    name: str | None = None,
) -> None:
    """Add a command to a group.

    Args:
        app: The application, or one of its subcommands' applications.
        command: The command; its docstring is the text of its own help.
        group: Title of its group in the help of `app`.
        summary: What it does, in about five words, for the list of commands.
        name: Its name; None for that of the function.
    """
    app.command(name, short_help=summary, rich_help_panel=group)(command)


def add_application(app: typer.Typer, commands: Any, group: str, summary: str) -> None:
    """Add a command that has commands of its own to a group.

    Args:
        app: The application.
        commands: The application with those commands; the docstring of its callback is its help.
        group: Title of its group in the help of `app`.
        summary: What it does, in about five words, for the list of commands.
    """
    app.add_typer(commands, short_help=summary, rich_help_panel=group)
