"""`camkit freeze-norms`: norms of a trained network become constants."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite


def freeze_norms(
    recipe: Annotated[Path, typer.Argument(help="The recipe (TOML) of the checkpoint.")],
    checkpoint: Annotated[Path, typer.Argument(help="A network with instance norms.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="The checkpoint with constants (.pt).")
    ],
    data: Annotated[
        Path | None, typer.Option(help="Folder of pictures to calibrate on; default: procedural.")
    ] = None,
    valid: Annotated[
        Path | None, typer.Option(help="Folder to state the cost on; default: procedural.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Samples to calibrate on.")] = 64,
    cache_dir: Annotated[Path, typer.Option(help="Folder for traced kernels.")] = Path("runs"),
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Make the instance norms of a network constants, and say what that costs (needs torch)."""
    from camkit.cli.design.design_time import print_report, refuse_existing, require_torch

    require_torch("camkit freeze-norms")
    refuse_existing([output], overwrite=overwrite)
    from camkit.export.frozen_norms import FreezeOptions, freeze_checkpoint

    options = FreezeOptions(pictures=data, valid=valid, cache_folder=cache_dir, samples=samples)
    output.parent.mkdir(parents=True, exist_ok=True)
    report = freeze_checkpoint(recipe, checkpoint, output, options)
    print_report({"output": str(output), **report.to_json()}, json_)
