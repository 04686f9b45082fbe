"""`camkit prepare`: whole frames of a camera with a haze, which its samples are cut from."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.design.export import HAZE_NAME, PSF_NAME
from camkit.cli.say import say


def prepare(
    recipe: Annotated[Path, typer.Argument(help="The recipe (TOML) of a camera with a haze.")],
    psf: Annotated[
        Path | None, typer.Option(help=f"Core kernels; default: {PSF_NAME} in --out-dir.")
    ] = None,
    haze: Annotated[
        Path | None, typer.Option(help=f"The haze beside them; default: {HAZE_NAME} there.")
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder of pictures; without it procedural scenes only.")
    ] = None,
    valid: Annotated[
        Path | None, typer.Option(help="Folder of pictures to validate on; default: procedural.")
    ] = None,
    out_dir: Annotated[
        Path, typer.Option(help="Folder of the runs; frames lie in NAME_frames below it.")
    ] = Path("runs"),
    seed: Annotated[int, typer.Option(min=0, help="Of scenes, places and noise.")] = 0,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Photograph whole frames and take their haze away, for `train` (needs torch)."""
    from camkit.cli.design.design_time import print_report, refuse_existing, require_torch
    from camkit.errors import ContractError

    require_torch("camkit prepare")
    from camkit.bundle.frozen_optics import FrozenOptics
    from camkit.bundle.haze_file import read_haze
    from camkit.bundle.psf_file import read_psf
    from camkit.export.frames import FrameSources, designed_lens, freeze_copies, prepare_frames
    from camkit.models_def.kinds.bayer.frames.tiles import HEADER, frames_folder
    from camkit.models_def.kinds.bayer.recipe import BayerRecipe
    from camkit.models_def.training.kind import read_recipe

    plan = read_recipe(recipe)
    if not isinstance(plan, BayerRecipe) or plan.haze is None:
        raise ContractError(
            f"{plan.name} has no haze; its samples are made while it trains, leave prepare out"
        )
    refuse_existing([frames_folder(out_dir, plan) / HEADER], overwrite=overwrite)
    optics = FrozenOptics(
        psf=read_psf(psf or out_dir / PSF_NAME), haze=read_haze(haze or out_dir / HAZE_NAME)
    )

    def tell(line: str) -> None:
        say(line, err=True)

    lens, copies = freeze_copies(plan, recipe.parent, tell)
    made = prepare_frames(
        plan,
        FrameSources(
            pictures={"train": data, "valid": valid},
            optics=optics,
            copies=copies,
            designed=designed_lens(lens),
            seed=seed,
        ),
        out_dir,
        tell,
    )
    print_report(made, json_)
