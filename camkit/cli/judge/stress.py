"""`camkit stress`: where a bundle's networks stop helping."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.progress import Task, working

if TYPE_CHECKING:
    from camkit.report.stress.stress_run import Progress


def stress(
    bundle: Annotated[
        str | None,
        typer.Argument(help="Camera bundle, NAME or PATH; optional with --list.", metavar="BUNDLE"),
    ] = None,
    scenarios: Annotated[
        str | None, typer.Option(help="Scenarios of --list to run, NAME,NAME; default: all.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Use few values and two scenes.")] = False,
    data: Annotated[
        Path | None, typer.Option(help="Folder of sharp pictures; default: procedural scenes.")
    ] = None,
    sizes: Annotated[
        str | None, typer.Option(help="Network sizes, such as S,M; default: all.")
    ] = None,
    scenes: Annotated[
        int | None, typer.Option(min=1, help="Number of scenes; default: 8, or 2 with --quick.")
    ] = None,
    compare: Annotated[
        str | None,
        typer.Option(help='Another bundle of this camera, drawn for comparison as "before".'),
    ] = None,
    out_dir: Annotated[
        Path | None,
        typer.Option(help="Folder for page, results and journal, to resume from; default: none."),
    ] = None,
    write: Annotated[
        bool, typer.Option("--write", help="Store the measured ranges in the bundle.")
    ] = False,
    list_: Annotated[
        bool, typer.Option("--list", help="List the scenarios (of BUNDLE, if given) and stop.")
    ] = False,
    json_: Annotated[
        bool, typer.Option("--json", help="Print the results as one JSON list.")
    ] = False,
    _debug: Debug = False,
) -> None:
    """Sweep one degradation at a time and report where the network stops helping."""
    from camkit.bundle.reader import find_bundle, open_bundle
    from camkit.report.stress.scenario import choose
    from camkit.report.stress.stress_run import (
        StressOptions,
        run_stress,
        scenarios_for,
        write_envelope,
    )

    if list_:
        opened = None if bundle is None else open_bundle(find_bundle(bundle))
        for scenario in choose(scenarios) if opened is None else scenarios_for(opened, scenarios):
            say(f"{scenario.name:20} {scenario.title}")
        return
    if bundle is None:
        raise ContractError("stress tests a bundle: give a NAME or PATH, or --list")
    if write and (quick or data is not None):
        raise ContractError(
            "--write stores ranges that captures are judged by: leave out --quick and --data"
        )
    opened = open_bundle(find_bundle(bundle))
    options = StressOptions(
        scenarios=scenarios_for(opened, scenarios),
        sizes=() if sizes is None else tuple(s.strip() for s in sizes.split(",")),
        scenes=scenes,
        quick=quick,
        data_folder=data,
        out_dir=out_dir,
    )
    earlier = None if compare is None else open_bundle(find_bundle(compare))
    with working("sweeping", unit="points") as task:
        result = run_stress(opened, options, earlier_bundle=earlier, progress=_teller(task))
    if write:
        write_envelope(opened, result.envelope)
    if json_:
        say(json.dumps(result.rows))
        return
    for row in result.rows:
        say(_line(row))
    if result.page is not None:
        say(f"page: {result.page}")
    for name, limits in result.envelope.items():
        say(f"{name}: {limits.low:.4g} to {limits.high:.4g}{' (stored)' if write else ''}")


def _line(row: dict[str, object]) -> str:
    """Return the line of one scenario: where it broke."""
    head = f"{row['scenario']:20} "
    if row["skipped"]:
        return f"{head}left out: {row['skipped']}"
    if row["break_point"] is None:
        return f"{head}{row['method']} sound over the range"
    low, high = ("beyond" if end is None else f"{end:g}" for end in row["ci"])  # type: ignore[attr-defined]
    if row["labels"]:
        name = row["labels"][row["values"].index(row["break_point"])]  # type: ignore[index,attr-defined]
        return f"{head}{row['method']} breaks at {name}: {row['break_reason']}"
    point = f"{row['break_point']:.3g} {row['unit']}".rstrip()
    return f"{head}{row['method']} breaks at {point} [{low} to {high}]: {row['break_reason']}"


def _teller(task: Task) -> "Progress":
    def progress(scenario: str, done: int, total: int) -> None:
        task.tell(f"sweeping {scenario}")
        task.count(done, total)

    return progress
