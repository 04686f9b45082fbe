"""`camkit network inspect`: everything in the way of a network, and what it costs."""

import json
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json
from camkit.cli.design.network.network_options import Config, Module, Network
from camkit.cli.exit_code import ExitCode
from camkit.cli.say import say


def inspect(
    network: Network,
    contract: Annotated[
        Path | None,
        typer.Option("--as", help="Contract (.toml) to compare the network with."),
    ] = None,
    module: Module = None,
    config: Config = None,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Show all obstacles of a network at once, with its reach, cost, memory and tiles."""
    from camkit.export.foreign import doors

    findings = doors.inspect_network(
        network, contract=contract, module=module, config=doors.to_config(config or [])
    )
    if json_:
        say(json.dumps(findings.to_json()))
    else:
        for line in findings.lines():
            say(line)
    if findings.obstacles:
        raise typer.Exit(ExitCode.INPUT_FAILED)
