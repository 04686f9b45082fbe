"""`camkit freeze`: a lens prescription to a frozen PSF."""

import json
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.errors import ContractError


def freeze(
    prescription: Annotated[Path, typer.Argument(help="The lens (.toml or .zmx).")],
    out: Annotated[Path, typer.Option("-o", "--out", help="The frozen PSF (.safetensors).")],
    recipe: Annotated[
        Path | None,
        typer.Option(help="Recipe (TOML) with the camera and its Wiener bank; default: duet's."),
    ] = None,
    depths_mm: Annotated[
        str | None,
        typer.Option(help="Object distances, near to far, such as 500,700,1500; default: lens's."),
    ] = None,
    limit_db: Annotated[float, typer.Option(help="Mean loss allowed for the samples.")] = 0.05,
    energy: Annotated[
        float, typer.Option(help="Least share of the light of a colour inside the kernels.")
    ] = 0.995,
    max_side_px: Annotated[int, typer.Option(help="Largest side of a kernel, odd.")] = 151,
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
    from camkit.cli.design.design_time import print_report, refuse_existing, require_torch

    require_torch("camkit freeze")
    refuse_existing([out, stress_out, report], overwrite=overwrite)
    from camkit.bundle.psf_file import write_psf
    from camkit.models_def.optics.freeze import FreezeGrid, freeze_prescription, freeze_stress
    from camkit.models_def.optics.lens_file.lens_file import read_lens
    from camkit.models_def.training.recipe import read_recipe

    plan = read_recipe(_default_recipe() if recipe is None else recipe)
    out.parent.mkdir(parents=True, exist_ok=True)
    grid = FreezeGrid(depths_mm=_depths(depths_mm), energy=energy, max_side_px=max_side_px)
    found = freeze_prescription(
        prescription,
        out,
        camera=plan.camera,
        settings=plan.wiener,
        limit_db=limit_db,
        grid=grid,
        tell=lambda line: typer.echo(line, err=True),
    )
    if stress_out is not None:
        stress_out.parent.mkdir(parents=True, exist_ok=True)
        write_psf(stress_out, freeze_stress(read_lens(prescription), plan.camera, grid).psf)
    if report is not None:
        report.parent.mkdir(parents=True, exist_ok=True)
        report.write_text(json.dumps(found.to_json(), indent=2) + "\n", encoding="utf-8")
    print_report(found.to_json(), json_)


def _depths(text: str | None) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(",")) if text is not None else ()
    except ValueError:
        raise ContractError(f"--depths-mm takes distances A,B,C in mm; got {text!r}") from None


def _default_recipe() -> Path:
    from importlib import resources

    return Path(str(resources.files("camkit.models_def.recipes"))) / "duet.toml"
