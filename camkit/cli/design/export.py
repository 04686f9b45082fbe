"""`camkit export`: checkpoints, frozen PSF, lens or plate to one proved bundle."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite

PSF_NAME = "psf.safetensors"
HAZE_NAME = "haze.safetensors"
STRESS_NAME = "stress_psf.safetensors"
STRESS_HAZE_NAME = "stress_haze.safetensors"
REPORT_NAME = "freeze.json"
PLAN_NAME = "plan.json"
NO_PLATE = "none"


def export(
    checkpoints: Annotated[
        list[Path],
        typer.Argument(help="Checkpoints, one per network size.", metavar="CHECKPOINT..."),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Bundle to write (.camkit).")],
    psf: Annotated[
        Path | None,
        typer.Option(help=f"PSF of `camkit freeze`; default: {PSF_NAME} beside the checkpoint."),
    ] = None,
    haze: Annotated[
        Path | None,
        typer.Option(
            help=f"Veiling glare of the optics; default: {HAZE_NAME} beside the PSF, if any."
        ),
    ] = None,
    stress_psf: Annotated[
        Path | None,
        typer.Option(help=f"Kernels off the design point; default: {STRESS_NAME} there, if any."),
    ] = None,
    stress_haze: Annotated[
        Path | None,
        typer.Option(
            help=f"Veiling glare of those kernels; default: {STRESS_HAZE_NAME} there, if any."
        ),
    ] = None,
    freeze: Annotated[
        Path | None,
        typer.Option(help=f"Report of `camkit freeze`; default: {REPORT_NAME} there, if any."),
    ] = None,
    plan: Annotated[
        Path | None,
        typer.Option(
            help=f"Calibration of --quality adaptive; default: {PLAN_NAME} there, if any."
        ),
    ] = None,
    prescription: Annotated[
        Path | None,
        typer.Option(help="Lens (.toml or .zmx); default: the checkpoint's."),
    ] = None,
    plate: Annotated[
        str | None,
        typer.Option(help="Plate (.toml or name), or 'none'; default: the checkpoint's."),
    ] = None,
    version: Annotated[str, typer.Option(help="Semantic version of the bundle.")] = "0.1.0",
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Pack checkpoints, PSF, lens or plate into a bundle and verify it (needs torch)."""
    from camkit.cli.design.design_time import print_report, refuse_existing, require_torch
    from camkit.errors import ContractError

    require_torch("camkit export")
    refuse_existing([out], overwrite=overwrite)
    folder = checkpoints[0].parent
    frozen = psf or _existing(folder, PSF_NAME)
    if frozen is None:
        raise ContractError(
            f"there is no {folder / PSF_NAME}; make it with `camkit freeze`, or add --psf"
        )
    stress = stress_psf or _existing(folder, STRESS_NAME)
    existing_haze = None if stress is None else _existing(stress.parent, STRESS_HAZE_NAME)
    from camkit.export.assemble import export_bundle
    from camkit.export.parts import Parts

    report = export_bundle(
        Parts(
            checkpoints=tuple(checkpoints),
            psf=frozen,
            haze=haze or _existing(frozen.parent, HAZE_NAME),
            stress_psf=stress,
            stress_haze=stress_haze or existing_haze,
            prescription=prescription,
            plate=None if plate in (None, NO_PLATE) else Path(plate),
            without_plate=plate == NO_PLATE,
            freeze=freeze or _existing(folder, REPORT_NAME),
            plan=plan or _existing(folder, PLAN_NAME),
            version=version,
        ),
        out,
    )
    print_report(report, json_)


def _existing(folder: Path, name: str) -> Path | None:
    path = folder / name
    return path if path.is_file() else None
