"""`camkit export`: checkpoints, frozen PSF, lens or plate to one proved bundle."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.export.parts import (
    HAZE_NAME,
    PLAN_NAME,
    PSF_NAME,
    REPORT_NAME,
    STRESS_HAZE_NAME,
    STRESS_NAME,
)


def export(
    checkpoints: Annotated[
        list[Path],
        typer.Argument(
            help="Checkpoints, one per network size; with --no-network a recipe (.toml).",
            metavar="CHECKPOINT...",
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Bundle to write (.camkit).")],
    psf: Annotated[
        Path | None,
        typer.Option(
            help=f"Frozen PSF; default: {PSF_NAME} beside the checkpoint, or the recipe's."
        ),
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
        typer.Option(help="Lens (.toml, .zmx or .json); default: the checkpoint's."),
    ] = None,
    plate: Annotated[
        str | None,
        typer.Option(help="Plate (.toml or name), or 'none'; default: the checkpoint's."),
    ] = None,
    network: Annotated[
        bool,
        typer.Option("--network/--no-network", help="Pack a network, or a recipe's filter alone."),
    ] = True,
    version: Annotated[str, typer.Option(help="Semantic version of the bundle.")] = "0.1.0",
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Pack checkpoints, PSF, lens or plate into a bundle and verify it (needs torch)."""
    from camkit.cli.design.design_time import print_report
    from camkit.export import packing

    report = packing.bundle(
        checkpoints,
        out,
        psf=psf,
        haze=haze,
        stress_psf=stress_psf,
        stress_haze=stress_haze,
        freeze=freeze,
        plan=plan,
        prescription=prescription,
        plate=plate,
        version=version,
        network=network,
        overwrite=overwrite,
    )
    print_report(report, json_)
