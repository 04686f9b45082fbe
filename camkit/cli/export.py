"""`camkit export`: checkpoints, frozen PSF and prescription to one proved bundle."""

from pathlib import Path
from typing import Annotated

import typer


def export(
    checkpoints: Annotated[
        list[Path], typer.Argument(help="One checkpoint per size.", metavar="CHECKPOINT...")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="The bundle (.camkit).")],
    psf: Annotated[Path, typer.Option(help="The frozen PSF, from `camkit freeze`.")],
    stress_psf: Annotated[
        Path | None, typer.Option(help="Kernels off the design point, from `camkit freeze`.")
    ] = None,
    prescription: Annotated[
        Path | None, typer.Option(help="The lens (TOML), to be traced afresh later.")
    ] = None,
    version: Annotated[str, typer.Option(help="Semantic version of the bundle.")] = "0.1.0",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace OUT.")] = False,
) -> None:
    """Pack checkpoints, PSF and prescription, and prove the result (needs torch)."""
    from camkit.cli.design_time import print_report, require_torch
    from camkit.errors import ContractError

    require_torch("camkit export")
    if out.exists() and not overwrite:
        raise ContractError(f"{out} exists; say --overwrite or another name")
    from camkit.export.assemble import Parts, export_bundle

    report = export_bundle(
        Parts(
            checkpoints=tuple(checkpoints),
            psf=psf,
            stress_psf=stress_psf,
            prescription=prescription,
            version=version,
        ),
        out,
    )
    print_report(report, as_json=False)
