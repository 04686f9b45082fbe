"""`camkit calibrate blur`: ordinary photographs of one lens to its PSF over the field."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Page, print_result, with_files
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options

if TYPE_CHECKING:
    from camkit.calibration.blur.blur_facts import PhotoBlur


def blur(
    files: Annotated[
        list[Path],
        typer.Argument(help="Photographs of one camera and lens at one setting, in focus."),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="PSF to write (.safetensors).")],
    page: Page = None,
    tone: Annotated[
        str | None,
        typer.Option(
            help="Codes to light of developed pictures: srgb, linear or FILE; default: as files "
            "state."
        ),
    ] = None,
    halves: Annotated[
        str | None,
        typer.Option(help="LEFT,RIGHT by which files of dual-pixel halves differ, such as _l,_r."),
    ] = None,
    pixel_pitch_um: Annotated[
        float | None, typer.Option(help="Pixel pitch in um; default: as the files state.")
    ] = None,
    reach_px: Annotated[
        float | None,
        typer.Option(help="Free px to both sides of an edge, 6 to 64; default: by the blur."),
    ] = None,
    depth_m: Annotated[
        float, typer.Option(help="Distance of the scenes in m ('inf' for infinity).")
    ] = float("inf"),
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Measure the PSF of a lens over the field on straight edges in photographs."""
    from camkit.calibrate import lens_blur

    result = lens_blur.blur(
        files,
        out,
        tone=tone,
        halves=halves,
        pixel_pitch_um=pixel_pitch_um,
        reach_px=reach_px,
        depth_m=depth_m,
        mosaic=mosaic_options(mosaic, black_level, white_level),
        page=page,
        overwrite=overwrite,
    )
    psf = result.psf
    summary = (
        f"{psf.field_heights_mm.size} heights, {psf.wavelengths_um.size} colours, "
        f"{psf.kernels.shape[-1]} px at {psf.pixel_pitch_um:g} um"
    )
    record = with_files(result.to_record(), out, page)
    print_result(record, _lines(result), as_json=json_, summary=summary)


def _lines(result: "PhotoBlur") -> list[str]:
    held_out, spare = result.held_out, result.uncertainty
    lines = [
        f"  {result.edges} edges of {len(result.photos)} photographs, {result.sharp} sharp, free "
        f"for {result.reach_px:g} px",
        f"  {held_out.edges} held-out edges: {held_out.percent:.2f} % of their step off "
        f"({held_out.in_noise:.1f} of the noise), by a round Gaussian "
        f"{held_out.gaussian_percent:.2f} % ({held_out.gaussian_in_noise:.1f})",
        f"  uncertainty: noise {spare.noise:.2g}, shift {spare.shift_px:.2g} px, width "
        f"{spare.width:.2g}",
    ]
    for height in result.heights:
        middle = len(height.spread_px) // 2
        (radial, tangential), error = height.spread_px[middle], height.spread_error_px[middle]
        lines.append(
            f"  {height.height_mm:6.2f} mm: {sum(height.edges)} edges, spread {radial:.2f} +- "
            f"{error[0]:.2f} px outward, {tangential:.2f} +- {error[1]:.2f} px across"
        )
    return lines
