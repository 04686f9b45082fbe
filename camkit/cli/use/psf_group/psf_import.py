"""`camkit psf import`: kernels in arrays, pictures or listings to a PSF."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Page, print_result, with_files
from camkit.errors import ContractError


def psf_import(
    source: Annotated[
        str,
        typer.Argument(
            help="File, folder, or pattern such as 'crops/psf_r{row}_c{col}.png'.",
            metavar="FILE|FOLDER|PATTERN",
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="PSF to write (.safetensors).")],
    page: Page = None,
    axes: Annotated[
        str | None,
        typer.Option(help="Axes of an array, out of row,col,i,c,h,w and 1; default: by its shape."),
    ] = None,
    colours: Annotated[
        str | None,
        typer.Option(
            help="Colours of axis c in their order, such as RGB; Y for all; default: RGB."
        ),
    ] = None,
    wavelengths_um: Annotated[
        str | None,
        typer.Option(help="Wavelengths of axis c in um, A,B,C, in place of --colours."),
    ] = None,
    variable: Annotated[
        str | None, typer.Option(help="Name of the array in a .npz or .mat of several.")
    ] = None,
    grid: Annotated[
        str | None,
        typer.Option(help="ROWSxCOLUMNS of a numbered stack, or of one picture of all kernels."),
    ] = None,
    pitch_um: Annotated[
        float | None, typer.Option(help="Spacing of the samples in um; default: as files state.")
    ] = None,
    to_pitch_um: Annotated[
        float | None,
        typer.Option(help="Pixel pitch of the sensor in um; default: that of the samples."),
    ] = None,
    span_mm: Annotated[
        str | None, typer.Option(help="WIDTHxHEIGHT from the first kernel to the last, in mm.")
    ] = None,
    frame_mm: Annotated[
        str | None,
        typer.Option(help="WIDTHxHEIGHT of the picture in mm, a kernel amid each equal part."),
    ] = None,
    x_mm: Annotated[
        str | None, typer.Option(help="Position of every column in mm, right of the axis, A,B,C.")
    ] = None,
    y_mm: Annotated[
        str | None, typer.Option(help="Position of every row in mm, down from the axis, A,B,C.")
    ] = None,
    heights_mm: Annotated[
        str | None,
        typer.Option(help="Distances from the axis in mm, of a lens of revolution, 0,A,B."),
    ] = None,
    flip: Annotated[
        str, typer.Option(help="Axes that run the other way: x, y or xy; kernels turns each.")
    ] = "",
    centre: Annotated[
        str, typer.Option(help="Middle of a kernel: middle, peak or centroid.")
    ] = "middle",
    background: Annotated[
        str, typer.Option(help="Level along the border: keep, or border to subtract it.")
    ] = "keep",
    side_px: Annotated[
        int | None, typer.Option(help="Odd side of the kernels in px; default: as files have it.")
    ] = None,
    depth_m: Annotated[
        float, typer.Option(help="Distance of the point in m ('inf' for infinity).")
    ] = float("inf"),
    uncertainty: Annotated[
        str | None,
        typer.Option(help="NOISE,SHIFT_PX,WIDTH of the kernels; default: estimated from them."),
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Convert kernels (npy, npz, mat, PNG, TIFF, EXR, Zemax text) to a PSF of camkit."""
    from camkit.calibrate import foreign_psf
    from camkit.calibration.psf_import.psf_facts import places_text

    for name, value, choices in (
        ("--centre", centre, ("middle", "peak", "centroid")),
        ("--background", background, ("keep", "border")),
    ):
        if value not in choices:
            raise ContractError(f"{name} takes {', '.join(choices)}; got {value}")
    result = foreign_psf.import_psf(
        source,
        out,
        axes=axes,
        colours=colours,
        wavelengths_um=wavelengths_um,
        variable=variable,
        grid=grid,
        pitch_um=pitch_um,
        to_pitch_um=to_pitch_um,
        span_mm=span_mm,
        frame_mm=frame_mm,
        x_mm=x_mm,
        y_mm=y_mm,
        heights_mm=heights_mm,
        flip=flip,
        centre=centre,  # type: ignore[arg-type]
        background=background,  # type: ignore[arg-type]
        side_px=side_px,
        depth_m=depth_m,
        uncertainty=uncertainty,
        page=page,
        overwrite=overwrite,
    )
    record = with_files({"source": source, **result.to_record()}, out, page)
    print_result(record, _lines(record), as_json=json_, summary=places_text(result.psf))


def _lines(record: dict[str, object]) -> list[str]:
    """Return what was normalised, and how far the kernels may be off."""
    normalised, uncertainty = record["normalised"], record["uncertainty"]
    assert isinstance(normalised, dict)
    assert isinstance(uncertainty, dict)
    low, high = normalised["sums"]
    row, column = normalised["middle_px"]
    how = "estimated" if uncertainty["estimated"] else "stated"
    return [
        f"  sums {low:g} to {high:g}, now 1; negative {normalised['negative_share']:.2%}, border "
        f"level {normalised['border_share']:.2%} of the light"
        + (", subtracted" if normalised["background_subtracted"] else ""),
        f"  middle at row {row}, column {column} (from 0), light up to "
        f"{normalised['centroid_px']:g} samples off it",
        f"  uncertainty ({how}): noise {uncertainty['noise']:g}, shift {uncertainty['shift_px']:g} "
        f"px, width {uncertainty['width']:g}",
    ]
