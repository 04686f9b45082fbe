"""`camkit plate design`: a relief found by gradients."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.progress import left_text, working

if TYPE_CHECKING:
    from camkit.models_def.design.plate.plate_loop import Moment


def design(
    recipe: Annotated[Path, typer.Argument(help="Plate recipe (.toml).", metavar="RECIPE")],
    out: Annotated[
        Path,
        typer.Option(
            "-o", "--out", help="Plate to write (.toml), with checkpoint and log beside it."
        ),
    ],
    steps: Annotated[
        int | None, typer.Option(min=1, help="Number of steps; default: the recipe's.")
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(help="Time limit in minutes; --resume continues; default: no limit."),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help="Random seed of start and etch errors; default: the recipe's."),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Number of torch threads.")] = 1,
    resume: Annotated[bool, typer.Option("--resume", help="Continue a run that stopped.")] = False,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Optimize the relief of a plate for target masks on the sensor (needs torch).

    With a table reader in its recipe, a network that recovers its pictures is fitted along.
    """
    from camkit.cli.design.design_time import require_torch

    require_torch("camkit plate design")
    from camkit.models_def.design.plate.plate_recipe import read_plate_recipe, with_plate_choices
    from camkit.models_def.design.plate.plate_run import PlateRun, PlateRunOptions

    if resume and overwrite:
        raise ContractError("--resume continues, --overwrite starts again: use one of them")
    if minutes is not None and not minutes > 0:
        raise ContractError(f"--minutes must be > 0; got {minutes:g}")
    run = PlateRun(
        with_plate_choices(read_plate_recipe(recipe), steps=steps, seed=seed),
        PlateRunOptions(
            out=out,
            recipe_folder=recipe.parent,
            seconds=math.inf if minutes is None else 60 * minutes,
            threads=threads,
            resume=resume,
            overwrite=overwrite,
        ),
    )
    total = run.recipe.schedule.steps
    with working(f"designing {run.recipe.name}", total, unit="steps", writes_lines=True) as task:
        task.begin(run.loop.step)
        for moment in run.go():
            task.count(moment.step)
            say(_line(moment) + left_text(task), err=True)
    report = run.finish()
    say(json.dumps(report) if json_ else _text(report))


def _line(moment: "Moment") -> str:
    core, streak, outer = (
        "/".join(f"{100 * share:.1f}" for share in shares)
        for shares in (
            moment.shares.core_share,
            moment.shares.streak_share,
            moment.shares.far_share,
        )
    )
    picture = moment.picture
    read = (
        ""
        if picture is None
        else f", read at {picture.db:.2f} dB (capture {picture.capture_db:.2f})"
    )
    return (
        f"step {moment.step}: loss {moment.loss:.5f} (best {moment.best_loss:.5f}), core {core} % "
        f"of the bare lens's, written {streak} %, of it far out {outer} %{read}, "
        f"{moment.seconds:.0f} s"
    )


def _text(report: dict[str, Any]) -> str:
    return (
        f"{report['name']}: loss {report['begin_loss']:.5f} -> {report['best_loss']:.5f} after "
        f"{report['steps']} of {report['of_steps']} steps\nplate: {report['plate']}\n"
        f"log: {report['log']}"
    )
