"""Options that kinds of cameras bring to `camkit process`, read from their register."""

import inspect
from collections.abc import Callable
from typing import Annotated, Any

import typer

from camkit.kinds import KindOption, all_kinds


def with_kind_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of every kind to a command; they reach it as further keywords.

    Args:
        command: Its last parameter is **of_kind.
    """
    whole = inspect.signature(command)
    plain = [p for p in whole.parameters.values() if p.kind is not inspect.Parameter.VAR_KEYWORD]
    added = {
        option.name: Annotated[
            str | None, typer.Option(f"--{option.name}", help=_help(kind, option))
        ]
        for kind, option in _options()
    }
    keywords = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=note)
        for name, note in added.items()
    ]
    # typer reads a command's options from here
    command.__signature__ = whole.replace(parameters=[*plain, *keywords])  # type: ignore[attr-defined]
    notes: dict[str, Any] = {p.name: p.annotation for p in plain}
    command.__annotations__ = {**notes, **added, "return": None}
    return command


def _options() -> list[tuple[str, KindOption]]:
    """Return (kind, option) for every option of a name, from the first kind that has it."""
    options: dict[str, tuple[str, KindOption]] = {}
    for kind in all_kinds():
        for option in kind.options:
            options.setdefault(option.name, (kind.name, option))
    return list(options.values())


def _help(kind: str, option: KindOption) -> str:
    choices = f": {', '.join(option.choices)}" if option.choices else ""
    text, mark, default = option.text.partition("; default: ")
    return f"{text.removesuffix('.')} ({kind}{choices}){mark}{default.removesuffix('.')}."
