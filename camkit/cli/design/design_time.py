"""Functions that the design-time commands share: the need of torch, existing files, reports."""

import json
from collections.abc import Iterable, Mapping
from importlib import util
from pathlib import Path

from camkit.cli.choices import INSTALLED_BY
from camkit.cli.say import say
from camkit.errors import ContractError, UnsupportedError


def require_torch(command: str) -> None:
    """Raise an error that says how to install torch, if it is not there.

    Raises:
        UnsupportedError: If torch cannot be imported.
    """
    if util.find_spec("torch") is None:
        raise UnsupportedError(
            f"{command} needs torch; install it from the checkout with: {INSTALLED_BY}"
        )


def refuse_existing(paths: Iterable[Path | None], *, overwrite: bool) -> None:
    """Refuse to write over a file before any work, unless the caller said so.

    Raises:
        ContractError: If one of the paths exists.
    """
    for path in paths:
        if path is not None and path.exists() and not overwrite:
            raise ContractError(f"{path} exists; add --overwrite or choose another name")


def print_report(report: Mapping[str, object], as_json: bool) -> None:
    """Print a flat report for people, or as one JSON object."""
    if as_json:
        say(json.dumps(report))
        return
    width = max(map(len, report), default=0)
    for name, value in report.items():
        say(f"{name:<{width}}  {value}")
