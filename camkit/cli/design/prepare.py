"""`camkit prepare`: whole frames of a camera with a haze, which its samples are cut from."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.export.parts import HAZE_NAME, PSF_NAME
from camkit.progress import note, working


def prepare(
    recipe: Annotated[Path, typer.Argument(help="Recipe (.toml) of a camera with veiling glare.")],
    psf: Annotated[
        Path | None,
        typer.Option(help=f"Kernels of the sharp peaks; default: {PSF_NAME} in --out-dir."),
    ] = None,
    haze: Annotated[
        Path | None,
        typer.Option(help=f"Veiling glare of the optics; default: {HAZE_NAME} in --out-dir."),
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder of pictures; default: procedural scenes.")
    ] = None,
    valid: Annotated[
        Path | None, typer.Option(help="Folder of validation pictures; default: procedural scenes.")
    ] = None,
    out_dir: Annotated[
        Path, typer.Option(help="Folder of the runs; frames go into NAME_frames below it.")
    ] = Path("runs"),
    seed: Annotated[
        int, typer.Option(min=0, help="Random seed of scenes, positions and noise.")
    ] = 0,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Simulate whole frames and remove their veiling glare, for `train` (needs torch)."""
    from camkit.cli.design.design_time import print_report, refuse_existing, require_torch

    require_torch("camkit prepare")
    from camkit.models_def.training.kind import read_recipe
    from camkit.models_def.training.preparing import PrepareOptions, preparing_kind

    plan = read_recipe(recipe)
    kind = preparing_kind(plan.kind)
    refuse_existing([kind.written_last(plan, out_dir)], overwrite=overwrite)
    options = PrepareOptions(
        psf=psf or out_dir / PSF_NAME,
        haze=haze or out_dir / HAZE_NAME,
        pictures=data,
        valid=valid,
        recipe_folder=recipe.parent,
        runs=out_dir,
        seed=seed,
    )
    with working(f"preparing frames of {plan.name}"):
        report = kind.prepare(plan, options, note)
    print_report(report, json_)
