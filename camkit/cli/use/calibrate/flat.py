"""`camkit calibrate flat`: pictures of an uneven display to the vignetting of a lens."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.outputs import Out, Outputs, Page
from camkit.cli.use.merge import BlackLevel, MosaicCfa, WhiteLevel

PixelPitchUm = Annotated[
    float | None, typer.Option(help="Pixel pitch; default: what the pictures state.")
]


def flat(
    files: Annotated[
        list[Path],
        typer.Argument(help="Linear pictures of one display or wall, the camera moved between."),
    ],
    out: Out,
    page: Page = None,
    shift_px: Annotated[
        list[str] | None,
        typer.Option(
            help="X,Y by which what is photographed moved in a picture, right and down; given "
            "again, once for each picture in their order; default: no shifts.",
            show_default=False,
        ),
    ] = None,
    turn_deg: Annotated[
        list[float] | None,
        typer.Option(
            help="Degrees by which it turned in a picture, clockwise; given again, once for each "
            "picture; default: what the orientation of the files says.",
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
    """Measure relative illumination, told from the display's own unevenness by poses."""
    outputs = Outputs.asked(out, page, overwrite=overwrite, as_json=json_)
    from camkit.cli.use.mosaic import mosaic_options
    from camkit.runtime.calibration.flat.measure import measure_flat

    found = measure_flat(
        files,
        shift_px,
        turn_deg,
        pixel_pitch_um=pixel_pitch_um,
        mosaic=mosaic_options(mosaic, black_level, white_level),
    )

    def shown() -> str:
        from camkit.report.calibration.flat_page import flat_html

        return flat_html(found)

    corner = f"{found.relative_illumination[-1]:.3f} at {found.heights_mm[-1]:.2f} mm"
    told = "told from" if found.separated else "not told from"
    lines = [
        f"  relative illumination {corner}, {told} the display, which is uneven by "
        f"{found.display:.1%}; {found.rest:.2%} are left"
    ]
    outputs.write(found.to_record(), lines, shown)
