"""What the design-time commands share: asking for torch, and printing a report."""

import json
from collections.abc import Mapping
from importlib import util

import typer

from camkit.errors import UnsupportedError


def require_torch(command: str) -> None:
    """Raise an error that says how to install torch, if it is not there."""
    if util.find_spec("torch") is None:
        raise UnsupportedError(f"{command} needs torch; install it with: pip install camkit[train]")


def print_report(report: Mapping[str, object], as_json: bool) -> None:
    """Print a flat report for people, or as one JSON object."""
    if as_json:
        typer.echo(json.dumps(report))
        return
    width = max(map(len, report), default=0)
    for name, value in report.items():
        typer.echo(f"{name:<{width}}  {value}")
