"""`camkit check`: prove a bundle, layer by layer."""

import json
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.exit_code import ExitCode


def check(
    bundle: Annotated[str, typer.Argument(help="Bundle NAME or PATH.", metavar="BUNDLE")],
    level: Annotated[
        str, typer.Option(help="schema, hash, graph, golden, tiling, range or all.")
    ] = "all",
    json_: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Prove a bundle: schema, hashes, graphs, golden cases, tiled = whole, fp16 range."""
    from camkit.bundle.reader import find_bundle
    from camkit.runtime.check import check_bundle
    from camkit.runtime.golden_run import develop_case

    path = Path(bundle) if Path(bundle).exists() else find_bundle(bundle)
    report = check_bundle(path, level=level, run=develop_case)
    if json_:
        typer.echo(json.dumps(report.to_json()))
    else:
        for line in report.lines():
            typer.echo(line)
    if not report.passed:
        raise typer.Exit(ExitCode.BUNDLE_REFUSED)
