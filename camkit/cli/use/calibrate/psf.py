"""`camkit calibrate psf`: a bracket of a small light, or an edge, to a frozen PSF."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Page, print_result, with_files
from camkit.cli.use.merge import Times
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options

if TYPE_CHECKING:
    from camkit.calibrate.photographs import PsfFacts


def psf(
    files: Annotated[
        list[Path],
        typer.Argument(help="Linear exposures of a point light, a disc or an edge in the dark."),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="PSF to write (.safetensors).")],
    page: Page = None,
    times: Times = None,
    dark: Annotated[
        list[Path] | None,
        typer.Option(help="Dark frame, at least one per exposure time; may be repeated."),
    ] = None,
    disc_px: Annotated[
        float | None,
        typer.Option(
            help="Diameter in px of a disc light, as a perfect lens would image it; default: a "
            "point."
        ),
    ] = None,
    edge: Annotated[
        bool,
        typer.Option(
            "--edge",
            help="Measure a slanted straight edge; the PSF is taken as rotationally symmetric.",
        ),
    ] = False,
    side_px: Annotated[
        int | None,
        typer.Option(help="Side of the kernels in px, odd; default: as far as light is seen."),
    ] = None,
    pixel_pitch_um: Annotated[
        float | None, typer.Option(help="Pixel pitch in um; default: as the frames state.")
    ] = None,
    depth_m: Annotated[
        float, typer.Option(help="Distance of the light in m ('inf' for infinity).")
    ] = float("inf"),
    dots: Annotated[
        Path | None,
        typer.Option(
            help="PSF (.safetensors) that a plate of dots was designed for, to sum its dots."
        ),
    ] = None,
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Merge a bracket of a point light, a disc or an edge into a PSF, every colour of sum 1."""
    from camkit.calibrate import photographs

    facts = photographs.psf(
        files,
        out,
        times_s=times,
        darks=dark or (),
        disc_px=disc_px,
        edge=edge,
        side_px=side_px,
        pixel_pitch_um=pixel_pitch_um,
        depth_m=depth_m,
        dots=dots,
        mosaic=mosaic_options(mosaic, black_level, white_level),
        page=page,
        overwrite=overwrite,
    )
    record = {**facts.to_record(), "out": str(out)}
    if facts.dots is not None:
        record["dots"] = facts.dots.to_json()
    x, y = facts.measured.centre_px
    summary = f"{facts.measured.side_px} px, the light at ({x:.2f}, {y:.2f})"
    print_result(with_files(record, out, page), _lines(facts), as_json=json_, summary=summary)


def _lines(facts: "PsfFacts") -> list[str]:
    if facts.dots is not None:
        return [
            f"  dots: {facts.dots.share:.1%} of the light in active areas, like the design by "
            f"{facts.dots.likeness:.4f}"
        ]
    lines = [
        f"  {field.peak_share:.2%} +- {field.peak_share_error:.2%} within 10 px, "
        f"{field.height_mm:.2f} mm from the middle"
        for field in facts.measured.fields
    ]
    for colour in facts.measured.colours:
        noise = (
            "" if colour.noise_floor is None else f", noise {colour.noise_floor:.1e} of the peak"
        )
        target = colour.reblurred
        rest = "" if target is None else f", blurred anew {target.rest:.2%} off"
        lines.append(f"  {colour.colour:<5}  {colour.core_share:.2%} within 3 px{noise}{rest}")
    return lines
