"""`camkit check`: prove a bundle, layer by layer."""

import json
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json
from camkit.cli.exit_code import ExitCode
from camkit.cli.say import say


def check(
    bundle: Annotated[str, typer.Argument(help="Camera bundle, NAME or PATH.", metavar="BUNDLE")],
    level: Annotated[
        str,
        typer.Option(
            help="All tests, or one with those it needs: schema, hash, graph, golden, tiling, "
            "range, laws."
        ),
    ] = "all",
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Verify a bundle: members, graphs, golden cases, tiling, range and laws of a picture."""
    from camkit.bundle.reader import find_bundle
    from camkit.runtime.proof.check import check_bundle
    from camkit.runtime.proof.golden_run import case_work

    report = check_bundle(find_bundle(bundle), level=level, run=case_work)
    if json_:
        say(json.dumps(report.to_json()))
    else:
        for line in report.lines():
            say(line)
    if not report.passed:
        raise typer.Exit(ExitCode.BUNDLE_REFUSED)
