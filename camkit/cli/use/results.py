"""Results of `camkit process` on stdout, failures and notes on stderr."""

import json
from typing import TYPE_CHECKING

from camkit.cli.say import said_together, say

if TYPE_CHECKING:
    from camkit.runtime.development import FileResult


def print_result(result: "FileResult", *, as_json: bool) -> None:
    """Print one file's result: JSON or a line on stdout, failures on stderr."""
    with said_together():
        if as_json:
            say(json.dumps(result.to_json()))
        elif result.status == "failed":
            say(f"{result.input}: failed: {result.error}", err=True)
        else:
            _print_made(result)


def _print_made(result: "FileResult") -> None:
    total = sum(result.seconds.values())
    head = f"{result.input} -> {result.output}"
    if result.status == "skipped":
        say(f"{head}: {'; '.join(result.warnings) or 'done before'}, skipped")
        return
    stages = ", ".join(f"{name} {value:.2f}" for name, value in result.seconds.items())
    extent = f"{result.extent}, " if result.extent else ""
    say(f"{head}: {extent}{total:.2f} s ({stages}), peak {result.peak_rss_mb:.0f} MB")
    for warning in result.warnings:
        say(f"  note: {warning}", err=True)
