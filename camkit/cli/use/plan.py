"""`camkit plan`: what would be done to captures, why, and what it would take."""

import inspect
from typing import Any

from camkit.cli.use.process import process

NOT_PLANNED = frozenset({"dry_run", "jobs", "resume", "overwrite"})
"""Options of `process` that say nothing about a plan."""


def plan(**choices: Any) -> None:
    """Print what `process` would do with the same options, why, and its time and memory."""
    process(**choices, dry_run=True, overwrite=True)


def _as_process() -> inspect.Signature:
    """Return the signature of `process` without the options that do not change a plan."""
    whole = inspect.signature(process)
    parameters = [p for name, p in whole.parameters.items() if name not in NOT_PLANNED]
    return whole.replace(parameters=parameters)


# typer reads a command's options from here; so the two commands can never differ.
plan.__signature__ = _as_process()  # type: ignore[attr-defined]
plan.__annotations__ = dict(process.__annotations__)
