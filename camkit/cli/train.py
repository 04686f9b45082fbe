"""`camkit train`: a recipe to a checkpoint."""

from pathlib import Path
from typing import Annotated

import typer


def train(
    recipe: Annotated[Path, typer.Argument(help="The recipe (TOML).")],
    size: Annotated[str, typer.Option(help="Which of the recipe's networks: S, M, ...")] = "M",
    data: Annotated[
        Path | None, typer.Option(help="Folder of pictures; without it procedural scenes only.")
    ] = None,
    valid: Annotated[
        Path | None, typer.Option(help="Folder of pictures to validate on.")
    ] = None,
    max_minutes: Annotated[float, typer.Option(help="Wall time of the run.")] = 60.0,
    out_dir: Annotated[Path, typer.Option(help="Folder for checkpoint and log.")] = Path("runs"),
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint.")] = False,
    threads: Annotated[int | None, typer.Option(help="Threads of torch.")] = None,
    device: Annotated[str, typer.Option(help="cpu or cuda.")] = "cpu",
) -> None:
    """Train one network of a recipe behind the Wiener bank of its frozen PSF (needs torch)."""
    from camkit.cli.design_time import print_report, require_torch

    require_torch("camkit train")
    from camkit.models_def.training.trainer import train as run

    result = run(
        recipe,
        size=size,
        data_folder=data,
        valid_folder=valid,
        max_minutes=max_minutes,
        resume=resume,
        out_dir=out_dir,
        threads=threads,
        device=device,
    )
    print_report(result.to_json(), as_json=False)
