"""`camkit freeze`: a lens prescription to a frozen PSF."""

from pathlib import Path
from typing import Annotated

import typer


def freeze(
    prescription: Annotated[Path, typer.Argument(help="The lens (TOML).")],
    out: Annotated[Path, typer.Option("-o", "--out", help="The frozen PSF (.safetensors).")],
    recipe: Annotated[
        Path | None, typer.Option(help="Recipe with the camera (TOML); default: duet's.")
    ] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Trace the lens and keep as few PSF samples as the stated loss allows (needs torch)."""
    from camkit.cli.design_time import require_torch

    require_torch("camkit freeze")
    from camkit.cli.design_time import print_report
    from camkit.models_def.optics.freeze import freeze_prescription
    from camkit.models_def.training.recipe import read_camera

    report = freeze_prescription(prescription, out, camera=read_camera(recipe))
    print_report(report.to_json(), json_)
