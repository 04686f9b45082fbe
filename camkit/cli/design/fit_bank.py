"""`camkit fit-bank`: the numbers of a bank that restores the colours of a camera together."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.progress import note, working


def fit_bank(
    recipe: Annotated[Path, typer.Argument(help="Training recipe (.toml) of the camera.")],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help="Recipe with the fitted numbers to write (.toml)."),
    ],
    data: Annotated[
        Path | None, typer.Option(help="Folder of pictures; default: procedural scenes.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Number of simulated samples.")] = 240,
    steps: Annotated[int, typer.Option(help="Number of optimization steps.")] = 160,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of samples and optimization.")] = 0,
    cache_dir: Annotated[Path, typer.Option(help="Folder that keeps traced kernels.")] = Path(
        "runs"
    ),
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Fit the filter bank that restores all colours jointly to a recipe's camera (needs torch)."""
    from camkit.cli.design.design_time import print_report, refuse_existing, require_torch

    require_torch("camkit fit-bank")
    refuse_existing([output], overwrite=overwrite)
    from camkit.models_def.training.bank_fitting import (
        BankFitOptions,
        bank_fitting_kind,
        check_text,
        with_bank,
    )
    from camkit.models_def.training.kind import read_recipe
    from camkit.runtime.output.part_file import atomic_output
    from camkit.side_file import read_side_text

    plan, text = read_recipe(recipe), read_side_text(recipe, "recipe")
    check_text(text)
    output.parent.mkdir(parents=True, exist_ok=True)
    options = BankFitOptions(
        pictures=data,
        recipe_folder=recipe.parent,
        output_folder=output.parent,
        cache_folder=cache_dir,
        samples=samples,
        steps=steps,
        seed=seed,
    )
    with working(f"fitting the bank of {plan.name}"):
        fit = bank_fitting_kind(plan.kind).fit(plan, options, note)
    with atomic_output(output) as part:
        part.write_text(with_bank(text, fit.together), encoding="utf-8")
    numbers = fit.together.model_dump(mode="json", exclude={"spread"})
    record = {"samples": fit.samples, "steps": fit.steps, "gain_db": round(fit.gain_db, 3)}
    print_report({"output": str(output), **record, **numbers}, json_)
