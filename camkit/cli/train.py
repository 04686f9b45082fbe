"""`camkit train`: a recipe to a checkpoint."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json


def train(
    recipe: Annotated[Path, typer.Argument(help="The recipe (TOML).")],
    size: Annotated[str, typer.Option(help="Which of the recipe's networks: S, M, ...")] = "M",
    data: Annotated[
        Path | None, typer.Option(help="Folder of pictures; without it procedural scenes only.")
    ] = None,
    valid: Annotated[
        Path | None, typer.Option(help="Folder of pictures to validate on; default: procedural.")
    ] = None,
    steps: Annotated[
        int | None, typer.Option(help="Steps of the whole schedule; default: the recipe's.")
    ] = None,
    max_minutes: Annotated[
        float | None,
        typer.Option(help="Wall time, decay included; default: until the steps are done."),
    ] = None,
    out_dir: Annotated[Path, typer.Option(help="Folder for checkpoint, log and samples.")] = Path(
        "runs"
    ),
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint.")] = False,
    threads: Annotated[int, typer.Option(help="Threads of torch.")] = 1,
    workers: Annotated[int, typer.Option(help="Processes that make samples.")] = 1,
    device: Annotated[str, typer.Option(help="cpu or cuda.")] = "cpu",
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Train one network of a recipe behind the Wiener bank of its lens (needs torch)."""
    from camkit.cli.design_time import print_report, require_torch

    require_torch("camkit train")
    from camkit.models_def.training.trainer import TrainOptions
    from camkit.models_def.training.trainer import train as run

    result = run(
        recipe,
        TrainOptions(
            out_dir=out_dir,
            size=size,
            data_folder=data,
            valid_folder=valid,
            steps=steps,
            max_minutes=max_minutes,
            resume=resume,
            threads=threads,
            workers=workers,
            device=device,
        ),
    )
    plain = {k: str(v) if isinstance(v, Path) else v for k, v in asdict(result).items()}
    print_report(plain, json_)
