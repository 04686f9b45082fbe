"""`camkit network add`: a network and its contract into a copy of a camera's bundle."""

import json
from pathlib import Path
from typing import Annotated, Final

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.design.network.network_options import Config, Module, Network
from camkit.cli.say import say

COST: Final = "statistics_cost_db"


def cost_text(cost_db: float) -> str:
    """Return what frozen or local statistics cost; by chance pictures may be better with them."""
    return f"{cost_db:.2f} dB" + (": no loss" if round(cost_db, 2) <= 0 else " lost")


def add(
    network: Network,
    contract: Annotated[
        Path, typer.Option(help="Contract (.toml): what the network takes and gives.")
    ],
    camera: Annotated[str, typer.Option("--to", help="Camera's bundle, NAME or PATH.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Bundle to write (.camkit).")],
    pairs: Annotated[
        Path | None,
        typer.Option(help="Pairs of your own script (.npz: input, output); default: contract's."),
    ] = None,
    module: Module = None,
    config: Config = None,
    name: Annotated[str | None, typer.Option(help="Camera's name; default: that of OUT.")] = None,
    version: Annotated[str, typer.Option(help="Semantic version of the bundle.")] = "0.1.0",
    licence: Annotated[str, typer.Option(help="Licence of the weights.")] = "not stated",
    training_data: Annotated[
        str, typer.Option(help="What the weights were trained on.")
    ] = "not stated",
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Add a trained network to a copy of a camera's bundle and prove it."""
    from camkit.export.foreign import doors

    report = doors.add_network(
        network,
        out,
        contract=contract,
        camera=camera,
        pairs=pairs,
        module=module,
        config=doors.to_config(config or []),
        name=name,
        version=version,
        licence=licence,
        training_data=training_data,
        overwrite=overwrite,
    )
    if json_:
        say(json.dumps(report))
        return
    warnings = report.pop("warnings")
    width = max(map(len, report))
    if COST in report:
        report[COST] = cost_text(report[COST])
    for key, value in report.items():
        say(f"{key:<{width}}  {value}")
    for warning in warnings:
        say(f"camkit: warning: {warning}", err=True)
