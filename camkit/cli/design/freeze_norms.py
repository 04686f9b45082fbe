"""`camkit freeze-norms`: norms of a trained network become constants."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite


def freeze_norms(
    recipe: Annotated[Path, typer.Argument(help="Recipe (.toml) of the checkpoint.")],
    checkpoint: Annotated[
        Path, typer.Argument(help="Checkpoint of a network with instance norms (.pt).")
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Checkpoint with constant norms to write (.pt).")
    ],
    data: Annotated[
        Path | None,
        typer.Option(help="Folder of calibration pictures; default: procedural scenes."),
    ] = None,
    valid: Annotated[
        Path | None,
        typer.Option(help="Folder of pictures to measure the loss on; default: procedural scenes."),
    ] = None,
    samples: Annotated[int, typer.Option(help="Number of calibration samples.")] = 64,
    cache_dir: Annotated[Path, typer.Option(help="Folder that keeps traced kernels.")] = Path(
        "runs"
    ),
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Replace the instance norms of a network with constants and report the loss (needs torch)."""
    from camkit.cli.design.design_time import print_report, refuse_existing, require_torch

    require_torch("camkit freeze-norms")
    refuse_existing([output], overwrite=overwrite)
    from camkit.models_def.training.frozen_norms import FreezeOptions, freeze_checkpoint

    options = FreezeOptions(pictures=data, valid=valid, cache_folder=cache_dir, samples=samples)
    output.parent.mkdir(parents=True, exist_ok=True)
    report = freeze_checkpoint(recipe, checkpoint, output, options)
    print_report({"output": str(output), **report.to_json()}, json_)
