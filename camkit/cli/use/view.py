"""`camkit view`: results of `camkit process` on one page."""

import json
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite, whole_pair
from camkit.cli.say import say


def view(
    results: Annotated[
        list[str],
        typer.Argument(help="Results, sidecars or folders with sidecars.", metavar="RESULT..."),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Page to write, NAME.html.")],
    before_file: Annotated[
        Path | None,
        typer.Option(
            "--before",
            help="Picture or capture to compare with; default: the capture that the sidecar names.",
        ),
    ] = None,
    crop: Annotated[
        list[str] | None,
        typer.Option(
            help="Centre X,Y in px of a part to show at 100 %, repeatable; default: chosen.",
            metavar="X,Y",
        ),
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Show results on a page: before and after, exposure, depth, and facts of the sidecars."""
    from camkit.report.view.page_making import view as write

    crops = [whole_pair(text, "--crop") for text in crop or ()]
    page = write(results, out, before_file=before_file, crops=crops, overwrite=overwrite)
    if json_:
        say(json.dumps(page.to_json()))
        return
    for note in page.notes:
        say(f"note: {note}", err=True)
    count = len(page.results)
    say(f"{page.path}: {count} result{'s' * (count > 1)}, {page.megabytes:.1f} MB")
