"""`camkit calibrate bundle`: what was measured of a camera, into a copy of a bundle."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Page, print_result, with_files


def bundle(
    source: Annotated[str, typer.Argument(metavar="FROM", help="Bundle to copy, NAME or PATH.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="New bundle to write (.camkit).")],
    geometry: Annotated[
        Path | None,
        typer.Option(help="Distortion and optical centre (.toml of `camkit calibrate geometry`)."),
    ] = None,
    flat: Annotated[
        Path | None, typer.Option(help="Vignetting (.toml of `camkit calibrate flat`).")
    ] = None,
    noise: Annotated[
        Path | None,
        typer.Option(help="Gain, read noise and levels (.toml of `camkit calibrate noise`)."),
    ] = None,
    psf: Annotated[
        Path | None,
        typer.Option(
            help="Kernels (.safetensors of `calibrate psf`, `psf import`); drops the networks."
        ),
    ] = None,
    keep_networks: Annotated[
        bool, typer.Option("--keep-networks", help="Keep the networks even if the kernels change.")
    ] = False,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Store the measurements of a camera in a copy of a bundle and verify it."""
    from camkit.calibrate import camera_bundles

    result = camera_bundles.bundle(
        source,
        out,
        geometry=geometry,
        flat=flat,
        noise=noise,
        psf=psf,
        keep_networks=keep_networks,
        page=page,
        overwrite=overwrite,
    )
    record = with_files(result.to_record(), out, page)
    line = f"  {record['from']} with {', '.join(record['measured'])} as measured"
    print_result(record, [line], as_json=json_)
