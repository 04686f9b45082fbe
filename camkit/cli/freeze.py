"""`camkit freeze`: a lens prescription to a frozen PSF."""

import json
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite


def freeze(
    prescription: Annotated[Path, typer.Argument(help="The lens (.toml or .zmx).")],
    out: Annotated[Path, typer.Option("-o", "--out", help="The frozen PSF (.safetensors).")],
    recipe: Annotated[
        Path | None,
        typer.Option(help="Recipe (TOML) with the camera and its Wiener bank; default: duet's."),
    ] = None,
    stress_out: Annotated[
        Path | None, typer.Option(help="Also write kernels off the design point there.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="Also write the report there, as JSON for `export`.")
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Trace the lens and keep as few PSF samples as the stated loss allows (needs torch)."""
    from camkit.cli.design_time import print_report, refuse_existing, require_torch

    require_torch("camkit freeze")
    refuse_existing([out, stress_out, report], overwrite=overwrite)
    from camkit.bundle.psf_file import write_psf
    from camkit.models_def.optics.freeze import freeze_prescription, freeze_stress
    from camkit.models_def.optics.lens_file.lens_file import read_lens
    from camkit.models_def.training.recipe import read_recipe

    plan = read_recipe(_default_recipe() if recipe is None else recipe)
    out.parent.mkdir(parents=True, exist_ok=True)
    found = freeze_prescription(prescription, out, camera=plan.camera, settings=plan.wiener)
    if stress_out is not None:
        stress_out.parent.mkdir(parents=True, exist_ok=True)
        write_psf(stress_out, freeze_stress(read_lens(prescription), plan.camera).psf)
    if report is not None:
        report.parent.mkdir(parents=True, exist_ok=True)
        report.write_text(json.dumps(found.to_json(), indent=2) + "\n", encoding="utf-8")
    print_report(found.to_json(), json_)


def _default_recipe() -> Path:
    from importlib import resources

    return Path(str(resources.files("camkit.models_def.recipes"))) / "duet.toml"
