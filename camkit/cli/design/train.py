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
    recipe: Annotated[Path, typer.Argument(help="The recipe (TOML).")],
    size: Annotated[str, typer.Option(help="Which of the recipe's networks: S, M, ...")] = "M",
    role: Annotated[
        str | None, typer.Option(help="Of which role; needed where a recipe has several.")
    ] = None,
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
    max_cpu_minutes: Annotated[
        float | None,
        typer.Option(help="CPU time, processes that make samples included; likewise."),
    ] = None,
    out_dir: Annotated[Path, typer.Option(help="Folder for checkpoint, log and samples.")] = Path(
        "runs"
    ),
    start: Annotated[
        Path | None,
        typer.Option(help="First weights: a checkpoint or bundle of any camera, same network."),
    ] = None,
    fine_tune: Annotated[
        Path | None,
        typer.Option(help="Fine-tune this checkpoint or bundle against discriminators."),
    ] = None,
    vgg: Annotated[
        Path | None,
        typer.Option(help="VGG-19 weights (.pth or .safetensors), where a loss looks at them."),
    ] = None,
    sharp: Annotated[
        Path | None,
        typer.Option(help="Folder of sharp pictures without captures, for a critic to know."),
    ] = None,
    pairs: Annotated[
        Path | None,
        typer.Option(help="Folder of real pairs, where the loss or --fine-tune takes them."),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint.")] = False,
    overwrite: Overwrite = False,
    threads: Annotated[int, typer.Option(help="Threads of torch.")] = 1,
    workers: Annotated[int, typer.Option(help="Processes that make samples.")] = 1,
    device: Annotated[str, typer.Option(help="cpu or cuda.")] = "cpu",
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Train one network of a recipe as its camera will run it (needs torch)."""
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
    """Say on stderr that features are a substitute, where a loss looks at any."""
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
