"""The options and the printed text that the commands of `camkit calibrate` share."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from camkit.cli.say import say

Out = Annotated[Path, typer.Option("-o", "--out", help="Result to write (.toml).")]
Page = Annotated[Path | None, typer.Option(help="Also write a self-contained page (.html).")]


def check_page(page: Path | None, *, overwrite: bool) -> None:
    """Refuse a page that is no HTML, or exists and may not be replaced.

    Raises:
        ContractError: If so.
    """
    from camkit.calibrate.result_files import check_result

    check_result(page, ".html", overwrite=overwrite)


def with_files(record: Mapping[str, Any], out: Path, page: Path | None) -> dict[str, Any]:
    """Return a record with the names of the written files."""
    files = {"out": out, "page": page}
    return {**record, **{name: str(path) for name, path in files.items() if path is not None}}


def print_result(
    record: Mapping[str, Any], lines: Sequence[str], *, as_json: bool, summary: str = ""
) -> None:
    """Print the results: one object, or notes on stderr, the files with a summary, and lines."""
    if as_json:
        say(json.dumps(record, allow_nan=False))
        return
    for note in record.get("notes", ()):
        say(f"note: {note}", err=True)
    files = [record[name] for name in ("out", "page") if name in record]
    head = f"{', '.join(files)}: {summary}".rstrip() if files else summary
    for line in (head, *lines):
        say(line)
