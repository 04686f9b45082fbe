"""`camkit calibrate flat`: pictures of an uneven display to the vignetting of a lens."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Out, Page, print_result, with_files
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options

PixelPitchUm = Annotated[
    float | None, typer.Option(help="Pixel pitch in um; default: as the pictures state.")
]


def flat(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Linear pictures of one display or wall, with the camera moved in between."
        ),
    ],
    out: Out,
    page: Page = None,
    shift_px: Annotated[
        list[str] | None,
        typer.Option(
            help="Shift X,Y of the display in px, right and down, repeated per picture; "
            "default: none.",
            show_default=False,
        ),
    ] = None,
    turn_deg: Annotated[
        list[float] | None,
        typer.Option(
            help="Clockwise turn of the display in degrees, repeated per picture; default: from "
            "the files.",
            show_default=False,
        ),
    ] = None,
    pixel_pitch_um: PixelPitchUm = None,
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Measure the vignetting of a lens, separated from an uneven display by several poses.

    --shift-px and --turn-deg are given once for each picture, in the order of FILES.
    """
    from camkit.calibrate import photographs

    facts = photographs.flat(
        files,
        out,
        shift_px=shift_px,
        turn_deg=turn_deg,
        pixel_pitch_um=pixel_pitch_um,
        mosaic=mosaic_options(mosaic, black_level, white_level),
        page=page,
        overwrite=overwrite,
    )
    corner = f"{facts.relative_illumination[-1]:.3f} at {facts.heights_mm[-1]:.2f} mm"
    separated = "told from" if facts.separated else "not told from"
    line = (
        f"  relative illumination {corner}, {separated} the display, which is uneven by "
        f"{facts.display:.1%}; {facts.rest:.2%} are left"
    )
    print_result(with_files(facts.to_record(), out, page), [line], as_json=json_)
