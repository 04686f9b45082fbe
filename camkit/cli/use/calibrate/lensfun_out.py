"""`camkit calibrate lensfun-out`: distortion and vignetting to an entry that lensfun reads."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Page, print_result, with_files


def lensfun_out(
    source: Annotated[
        Path,
        typer.Argument(
            help="Bundle (NAME or PATH), or geometry (.toml of `camkit calibrate geometry`)."
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Entry for lensfun to write (.xml).")],
    focal_mm: Annotated[
        float | None,
        typer.Option(
            help="Focal length in mm, required for a bundle; default: that of the geometry."
        ),
    ] = None,
    lens_name: Annotated[
        str | None, typer.Option(help="Model of the lens; default: the name of the source.")
    ] = None,
    maker: Annotated[str, typer.Option(help="Maker of the lens.")] = "Generic",
    mount: Annotated[
        str, typer.Option(help="Mount of the camera, as named in the database.")
    ] = "Generic",
    crop_factor: Annotated[
        float | None,
        typer.Option(
            help="Crop factor, required for a geometry; default: from the sensor of the bundle."
        ),
    ] = None,
    aperture: Annotated[
        float | None,
        typer.Option(
            help="F-number at which the vignetting of a bundle is written; default: no vignetting."
        ),
    ] = None,
    most_residual_px: Annotated[
        float, typer.Option(help="Largest misfit of the distortion model in px.")
    ] = 0.5,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Write distortion and vignetting of a bundle or a measured geometry for lensfun."""
    from camkit.calibrate import camera_bundles

    entry = camera_bundles.lensfun_out(
        source,
        out,
        focal_mm=focal_mm,
        lens_name=lens_name,
        maker=maker,
        mount=mount,
        crop_factor=crop_factor,
        aperture=aperture,
        most_residual_px=most_residual_px,
        page=page,
        overwrite=overwrite,
    )
    fit = entry.fit
    line = (
        f"  {entry.name.model}, {fit.distortion.model} at {fit.distortion.focal_mm:g} mm, misses "
        f"by {fit.residual_px:.3f} px"
    )
    print_result(with_files(entry.to_record(), out, page), [line], as_json=json_)
