"""`camkit train`: a recipe to a checkpoint."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.stopwatch import Stopwatch


def train(
    context: typer.Context,
    recipe: Annotated[Path, typer.Argument(help="Training recipe (.toml).")],
    size: Annotated[
        str, typer.Option(help="Network of the recipe to train, such as S or M.")
    ] = "M",
    role: Annotated[
        str | None, typer.Option(help="Role of the network, required if the recipe has several.")
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder of pictures; default: procedural scenes.")
    ] = None,
    valid: Annotated[
        Path | None, typer.Option(help="Folder of validation pictures; default: procedural scenes.")
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(help="Number of steps of the whole schedule; default: the recipe's."),
    ] = None,
    max_minutes: Annotated[
        float | None,
        typer.Option(help="Limit of wall time in minutes, decay included; default: no limit."),
    ] = None,
    max_cpu_minutes: Annotated[
        float | None,
        typer.Option(
            help="Limit of CPU time in minutes, all processes included; default: no limit."
        ),
    ] = None,
    out_dir: Annotated[Path, typer.Option(help="Folder for checkpoint, log and samples.")] = Path(
        "runs"
    ),
    start: Annotated[
        Path | None,
        typer.Option(
            help="Checkpoint or bundle with initial weights of the same network; default: "
            "random weights."
        ),
    ] = None,
    fine_tune: Annotated[
        Path | None,
        typer.Option(help="Checkpoint or bundle to fine-tune with discriminators."),
    ] = None,
    vgg: Annotated[
        Path | None,
        typer.Option(
            help="VGG-19 weights (.pth or .safetensors), for losses that compare features."
        ),
    ] = None,
    sharp: Annotated[
        Path | None,
        typer.Option(
            help="Folder of sharp pictures without captures, for the critic of an adversarial loss."
        ),
    ] = None,
    pairs: Annotated[
        Path | None,
        typer.Option(help="Folder of real pairs (pairs.toml), mixed into the batches."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue from the checkpoint in --out-dir.")
    ] = False,
    overwrite: Overwrite = False,
    threads: Annotated[int, typer.Option(help="Number of torch threads.")] = 1,
    workers: Annotated[int, typer.Option(help="Number of processes that make samples.")] = 1,
    device: Annotated[str, typer.Option(help="Device to train on: cpu or cuda.")] = "cpu",
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Train one restoration network of a recipe (needs torch)."""
    from camkit.cli.design.design_time import print_report
    from camkit.models_def.face import network_training

    result = network_training.train(
        recipe,
        out_dir,
        size=size,
        role=role,
        data=data,
        valid=valid,
        steps=steps,
        max_minutes=max_minutes,
        max_cpu_minutes=max_cpu_minutes,
        start=start,
        fine_tune=fine_tune,
        vgg=vgg,
        sharp=sharp,
        pairs=pairs,
        resume=resume,
        overwrite=overwrite,
        threads=threads,
        workers=workers,
        device=device,
        on_note=lambda text: say(f"camkit: {text}", err=True),
        stopwatch=context.find_object(Stopwatch),
    )
    print_report(result.to_json(), json_)
