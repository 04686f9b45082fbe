"""`camkit calibrate pairs`: captures of shown pictures to pairs for training."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Page, print_result, with_files


def pairs(
    captures: Annotated[
        list[Path],
        typer.Argument(
            help="Linear captures of the screen, or folders; the --targets folder may come last.",
        ),
    ],
    geometry: Annotated[
        Path, typer.Option(help="Geometry of the camera (.toml of `camkit calibrate geometry`).")
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder to write, for `camkit train --pairs`.")
    ],
    targets: Annotated[
        Path | None,
        typer.Option(help="Folder of `camkit calibrate targets`; default: the last argument."),
    ] = None,
    tone: Annotated[
        Path | None,
        typer.Option(
            help="Tone curve of the display (.toml of `camkit calibrate tone`); default: sRGB."
        ),
    ] = None,
    flat: Annotated[
        Path | None,
        typer.Option(help="Vignetting (.toml of `camkit calibrate flat`); default: none."),
    ] = None,
    most_residual_px: Annotated[
        float, typer.Option(help="Largest RMS misalignment of picture and capture in px.")
    ] = 0.5,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Align displayed pictures with their captures, as pairs for `camkit train --pairs`."""
    from camkit.calibrate import displays

    aligned = displays.pairs(
        captures,
        geometry,
        out,
        targets=targets,
        tone=tone,
        flat=flat,
        most_residual_px=most_residual_px,
        page=page,
        overwrite=overwrite,
    )
    worst = max(aligned.pairs, key=lambda pair: pair.residual_px)
    lines = [f"  at worst {worst.residual_px:.3f} px RMS, in {worst.path.name}"]
    if aligned.primaries is not None:
        lines.append(
            f"  colours of the display to {100 * aligned.primaries.residual:.2g} % of white"
        )
    record = with_files(aligned.to_record(), out, page)
    summary = f"{len(aligned.pairs)} pairs at ISO {aligned.iso:g}"
    print_result(record, lines, as_json=json_, summary=summary)
