"""`camkit calibrate geometry`: photographs of a checkerboard to focal length and distortion."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.outputs import Out, Outputs, Page

if TYPE_CHECKING:
    from camkit.runtime.calibration.geometry.geometry import Geometry


def geometry(
    pictures: Annotated[
        list[Path],
        typer.Argument(help="Photographs of the board, at one setting of lens and focus."),
    ],
    board: Annotated[str, typer.Option(help="COLUMNSxROWS of its inner corners, like 9x6.")],
    out: Out,
    square_mm: Annotated[
        float | None, typer.Option(help="Side of a square; tells how far away the board was.")
    ] = None,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Measure focal length, optical centre and distortion on photographs of a checkerboard."""
    outputs = Outputs.asked(out, page, overwrite=overwrite, as_json=json_)
    from camkit.runtime.calibration.geometry.board import Board
    from camkit.runtime.calibration.geometry.geometry import calibrate_geometry

    found = calibrate_geometry(pictures, Board.read(board, square_mm))
    outputs.write(found.to_record(), _lines(found), lambda: _page(found))


def _lines(found: "Geometry") -> list[str]:
    x, y = found.camera.centre_px
    seen = sum(view.corners is not None for view in found.views)
    chosen = found.chosen
    return [
        f"  {found.camera.model.name}: focal length {found.camera.focal_px:.2f} px, centre "
        f"({x:.2f}, {y:.2f}) of {found.size[0]}x{found.size[1]} px",
        f"  {chosen.fit.rms_px:.3f} px rms in {seen} of {len(found.views)} pictures; left out "
        f"{chosen.rms_px:.3f}, at worst {chosen.worst_px:.3f}",
        f"  known to {found.coverage.radius_px:.0f} px from the centre, of "
        f"{found.coverage.corner_px:.0f}; polynomial to {found.radial.residual_px:.3f} px",
    ]


def _page(found: "Geometry") -> str:
    from camkit.report.calibration.geometry import geometry_sections
    from camkit.report.calibration.page import to_html

    return to_html("camkit calibrate geometry", geometry_sections(found))
