"""`camkit train`: a recipe to a checkpoint."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.stopwatch import Stopwatch

WITHOUT_VGG = (
    "no --vgg FILE: the perceptual term of eq. (6.12) compares sRGB values, not VGG-19 features"
)

SUBSTITUTE = "no --vgg FILE: features are those of random weights in place of VGG-19"

if TYPE_CHECKING:
    from camkit.models_def.training.refinement import Refinement


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
        typer.Option(help="Folder of real pairs, for --fine-tune and losses that use pairs."),
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
    from camkit.cli.design.design_time import print_report, require_torch

    require_torch("camkit train")
    from camkit.models_def.training.trainer import TrainOptions
    from camkit.models_def.training.trainer import train as run

    refinement: Refinement | None = None
    if fine_tune is not None:
        if sharp is not None:
            raise ContractError("--sharp is for a critic; fine-tuning has none: leave it away")
        refinement = _fine_tuning(recipe, fine_tune, size, vgg, pairs, device)
    elif vgg is None:
        _tell_substitute(recipe, size, role)
    result = run(
        recipe,
        TrainOptions(
            out_dir=out_dir,
            size=size,
            role=role,
            data_folder=data,
            valid_folder=valid,
            steps=steps,
            max_minutes=max_minutes,
            max_cpu_minutes=max_cpu_minutes,
            start=start,
            resume=resume,
            overwrite=overwrite,
            threads=threads,
            workers=workers,
            device=device,
            vgg=None if refinement is not None else vgg,
            sharp_folder=sharp,
            pairs=None if refinement is not None else pairs,
        ),
        refinement=refinement,
        stopwatch=context.find_object(Stopwatch),
    )
    print_report(result.to_json(), json_)


def _tell_substitute(recipe: Path, size: str, role: str | None) -> None:
    """Report on stderr that features are a substitute, where a loss uses any."""
    from camkit.models_def.training.kind import read_recipe
    from camkit.models_def.training.recipe import PICTURE_LOSSES

    schedule = read_recipe(recipe).network(size, role).schedule
    if schedule.loss in PICTURE_LOSSES and schedule.content.looks:
        say(f"camkit: {SUBSTITUTE}", err=True)


def _fine_tuning(
    recipe: Path, start: Path, size: str, vgg: Path | None, pairs: Path | None, device: str
) -> "Refinement":
    from camkit.models_def.training.kind import read_recipe
    from camkit.models_def.training.refinement import FineTuningOptions, refining_kind

    if vgg is None:
        say(f"camkit: {WITHOUT_VGG}", err=True)
    options = FineTuningOptions(
        start=start,
        size=size,
        vgg=vgg,
        pairs=pairs,
        device=device,
        recipe_folder=recipe.parent,
    )
    plan = read_recipe(recipe)
    return refining_kind(plan.kind).refinement(plan, options)
