"""`camkit design`: a lens and its network designed together."""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.progress import left_text, working

if TYPE_CHECKING:
    from camkit.models_def.design.loop import Progress
    from camkit.models_def.design.run import DesignRun

MUCH_LOST = 0.02


def design(
    recipe: Annotated[Path, typer.Argument(help="Design recipe (.toml).", metavar="RECIPE")],
    data: Annotated[
        Path | None, typer.Option(help="Folder of sharp pictures; default: procedural scenes.")
    ] = None,
    out_dir: Annotated[
        Path | None,
        typer.Option(help="Folder for lens, checkpoint, log and pictures; default: runs/NAME."),
    ] = None,
    steps: Annotated[
        int | None, typer.Option(min=1, help="Number of steps; default: the recipe's.")
    ] = None,
    lens_rate: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="Learning rate of the lens (0 trains the network alone); default: the recipe's.",
        ),
    ] = None,
    prescription: Annotated[
        str | None,
        typer.Option(help="Lens to start from, a name or a lens file; default: the recipe's."),
    ] = None,
    search: Annotated[
        bool,
        typer.Option(help="Search the recipe's \\[starts] first, or start at the lens itself."),
    ] = True,
    library: Annotated[
        bool | None,
        typer.Option(
            "--library/--no-library",
            help="Search from built-in lenses, scaled to the recipe, too; default: the recipe's.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            help="Random seed of weights and samples, not of \\[starts]; default: the recipe's."
        ),
    ] = None,
    pictures: Annotated[
        int,
        typer.Option(
            min=0, help="Draw lens, PSFs and patches every N steps (at validations) and at the end."
        ),
    ] = 0,
    threads: Annotated[int, typer.Option(min=1, help="Number of torch threads.")] = 1,
    resume: Annotated[bool, typer.Option("--resume", help="Continue a run that stopped.")] = False,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Design a lens together with the network that removes its blur (needs torch)."""
    from camkit.cli.design.design_time import require_torch
    from camkit.report.judge_need import require_judge

    require_torch("camkit design")
    if pictures:
        require_judge()
    from camkit.models_def.design.design_recipe import read_design, with_choices
    from camkit.models_def.design.run import DesignOptions, DesignRun

    if resume and overwrite:
        raise ContractError("--resume continues, --overwrite starts again: use one of them")
    plan = with_choices(
        read_design(recipe),
        steps=steps,
        lens_rate=lens_rate,
        prescription=prescription,
        seed=seed,
        search=search,
        library=library,
    )
    searches = plan.starts.searches and plan.schedule.lens_rate and not resume
    if searches:
        places = " and the built-in lenses" if plan.starts.library else ""
        say(f"trying {plan.starts.count} starts{places}", err=True)
    with working("trying starts" if searches else "reading the lens"):
        run = DesignRun(
            plan,
            DesignOptions(
                out_dir=out_dir or Path("runs") / plan.name,
                recipe_folder=recipe.parent,
                pictures=data,
                threads=threads,
                resume=resume,
                overwrite=overwrite,
            ),
        )
    for line in _first_lines(run, resume=resume):
        say(line, err=True)
    _take_steps(run, pictures)
    if run.leads:
        report = run.finish()
        say(json.dumps(report) if json_ else _text(report))


def _take_steps(run: "DesignRun", pictures: int) -> None:
    """Run all steps, with a line for every validation and a picture every so many steps."""
    plan, total, drawn_step = run.recipe, run.recipe.schedule.steps, run.loop.step
    with working(f"designing {plan.name}", total, unit="steps") as task:
        task.begin(run.loop.step)
        is_saved = run.files.resumes
        try:
            for moment in run.go(on_step=task.count):
                is_saved = True
                say(_line(moment, is_psnr=plan.loss.is_psnr) + left_text(task), err=True)
                if moment.step == 0:
                    _note_limits(run, moment)
                    task.begin(0)
                is_drawing = pictures > 0 and run.leads
                if is_drawing and is_picture_due(moment.step, drawn_step, pictures, total):
                    _draw(run, moment)
                    drawn_step = moment.step
        except KeyboardInterrupt:
            if run.leads and is_saved:
                say(
                    f"{run.files.checkpoint} is kept: the same command with --resume, without "
                    "--overwrite, continues it",
                    err=True,
                )
            raise


def is_picture_due(step: int, drawn_step: int, every: int, total: int) -> bool:
    """Return whether a multiple of `every` lies beyond the last picture, or the run ends.

    Moments come at validations, so a picture may come some steps late, but none is left out.
    """
    return step // every > drawn_step // every or step == total


def _first_lines(run: "DesignRun", *, resume: bool) -> Iterator[str]:
    """Yield the lines that stand before the first step: where it begins, a lens that rests."""
    views = run.loop.parts.lens.views()
    outside = [pair for problem, _ in views for pair in problem.free.outside()]
    for variable, value in dict.fromkeys(outside):  # shared ones come with every configuration
        yield (
            f"{variable.kind} of surface {variable.surface}: the given lens has {value:.6g}, "
            f"outside its bounds {variable.low:g} .. {variable.high:g}: it begins at the bound"
        )
    if run.searched_s:
        yield f"starts tried in {run.searched_s:.0f} s"
    if run.recipe.starts.library:
        yield f"begins at {run.loop.parts.start or run.recipe.prescription}"
    schedule = run.recipe.schedule
    if resume and run.files.resumes:
        yield f"resumes at step {run.loop.step} of {schedule.steps}"
    elif resume:
        yield f"there is no {run.files.checkpoint} to resume: begins at step 0"
    has_network = run.loop.parts.network is not None
    steps = range(schedule.steps)
    moves = any(schedule.moves_lens(step, has_network=has_network) for step in steps)
    if schedule.lens_rate and not moves:
        keys = f"freeze_share ({schedule.freeze_share:g})"
        if has_network:
            keys = f"hold_steps ({schedule.hold_steps}) or {keys}"
        yield (
            f"the lens stays as it is in all {schedule.steps} steps: lower schedule.{keys}, or "
            "take more steps"
        )


def _note_limits(run: "DesignRun", first: "Progress") -> None:
    """Print what the lens at the start breaks, since it counts in the choice of the best."""
    from camkit.models_def.optics.search.problem import broken_limits

    views = run.loop.parts.lens.views()
    names = dict.fromkeys(key for view in views for key in broken_limits(*view))
    if not names:
        return
    cost = (
        f", which counts as {first.valid_db - first.merit:.3g} dB against it: a lens that breaks "
        "less of them may win with fewer dB"
    )
    say(
        f"the lens at the start is outside its [limits] ({', '.join(names)})"
        + (cost if run.recipe.loss.is_psnr else ""),
        err=True,
    )


def _line(moment: "Progress", *, is_psnr: bool) -> str:
    lost_text = f", {moment.lost_light:.0%} of the light beyond kernel_px at the worst field"
    loss_text = "" if math.isnan(moment.loss) else f"loss {moment.loss:.4f}, "
    if not is_psnr:
        mark = f", judged by its loss {-moment.merit:.4f} (least {-moment.best_merit:.4f})"
    elif (moment.merit, moment.best_merit) == (moment.valid_db, moment.best_db):
        mark = f" (best {moment.best_db:.3f})"
    else:
        mark = f", {moment.merit:.3f} dB less its [limits] (best {moment.best_merit:.3f})"
    return (
        f"step {moment.step}: {loss_text}validation {moment.valid_db:.3f} dB{mark}, "
        f"{moment.seconds:.0f} s" + (lost_text if moment.lost_light > MUCH_LOST else "")
    )


def _draw(run: "DesignRun", moment: "Progress") -> None:
    from camkit.report.pages.lens.design_picture import draw_design

    path = run.options.out_dir / f"{run.recipe.name}_{moment.step:06}.png"
    draw_design(run.view(), path)
    say(str(path), err=True)


def _text(report: dict[str, Any]) -> str:
    begin, best = report["begin_merit"], report["best_merit"]
    by_limits = report["is_psnr"] and (begin, best) != (report["begin_db"], report["best_db"])
    lines = [
        f"{report['name']}: validation {report['begin_db']:.3f} -> {report['best_db']:.3f} dB "
        f"after {report['steps']} steps"
    ]
    if report["best_step"] == 0:
        lines.append("no lens was better than the one at the start, which is kept")
    elif by_limits and begin is not None:
        lines.append(f"chosen by the dB less what [limits] cost: {begin:.3f} -> {best:.3f} dB")
    elif begin is not None and not report["is_psnr"]:
        lines.append(f"chosen by the loss: {-begin:.4f} -> {-best:.4f}")
    return "\n".join([*lines, f"lens: {report['lens']}", f"log: {report['log']}"])
