"""`camkit calibrate geometry`: photographs of a checkerboard to focal length and distortion."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Out, Page, print_result, with_files

if TYPE_CHECKING:
    from camkit.calibration.geometry.geometry import Geometry


def geometry(
    pictures: Annotated[
        list[Path],
        typer.Argument(
            help="Photographs of the board at one lens and focus setting, or corners (.json)."
        ),
    ],
    out: Out,
    board: Annotated[
        str | None,
        typer.Option(
            help="Inner corners of the board, COLUMNSxROWS such as 9x6; default: a corner file's."
        ),
    ] = None,
    square_mm: Annotated[
        float | None,
        typer.Option(help="Side of a square in mm, to measure the distance of the board."),
    ] = None,
    focal_px: Annotated[
        float | None,
        typer.Option(help="Nominal focal length in px, kept if the pictures do not determine it."),
    ] = None,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Measure focal length, optical centre and distortion from photographs of a checkerboard."""
    from camkit.calibrate import photographs

    facts = photographs.geometry(
        pictures,
        out,
        board=board,
        square_mm=square_mm,
        focal_px=focal_px,
        page=page,
        overwrite=overwrite,
    )
    print_result(with_files(facts.to_record(), out, page), _lines(facts), as_json=json_)


def _lines(facts: "Geometry") -> list[str]:
    x, y = facts.camera.centre_px
    seen_count = sum(view.corners is not None for view in facts.views)
    fit = facts.best
    return [
        f"  {facts.camera.model.name}: focal length {facts.camera.focal_px:.2f} px, centre "
        f"({x:.2f}, {y:.2f}) of {facts.size[0]}x{facts.size[1]} px",
        f"  error {fit.fit.rms_px:.3f} px rms in {seen_count} of {len(facts.views)} pictures; in "
        f"pictures left out of the fit {fit.rms_px:.3f} px, at worst {fit.worst_px:.3f} px",
        f"  corners reach {facts.coverage.radius_px:.0f} px from the centre, of "
        f"{facts.coverage.corner_px:.0f} px to the picture's corner; the distortion polynomial "
        f"fits the model to {facts.radial.residual_px:.3f} px",
    ]
