"""`camkit calibrate geometry`: photographs of a checkerboard to focal length and distortion."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.outputs import Out, Outputs, Page
from camkit.errors import ContractError

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
    outputs = Outputs.asked(out, page, overwrite=overwrite, as_json=json_)
    found = _found(pictures, board, square_mm, focal_px)
    outputs.write(found.to_record(), _lines(found), lambda: _page(found))


def _found(
    pictures: list[Path], board: str | None, square_mm: float | None, focal_px: float | None
) -> "Geometry":
    from camkit.calibration.geometry.board import Board
    from camkit.calibration.geometry.corner_file import is_corner_file, read_corners
    from camkit.calibration.geometry.geometry import calibrate_corners, calibrate_geometry

    if not is_corner_file(pictures):
        if board is None:
            raise ContractError("--board is needed: COLUMNSxROWS of its inner corners, like 9x6")
        return calibrate_geometry(pictures, Board.read(board, square_mm), focal_px)
    given = read_corners(pictures[0])
    asked = Board.read(str(given.board) if board is None else board, square_mm)
    if str(asked) != str(given.board):
        raise ContractError(f"{pictures[0]} holds corners of a board of {given.board}, not {asked}")
    if square_mm is not None:
        given = replace(given, board=asked)
    return calibrate_corners(given, focal_px)


def _lines(found: "Geometry") -> list[str]:
    x, y = found.camera.centre_px
    seen = sum(view.corners is not None for view in found.views)
    chosen = found.chosen
    return [
        f"  {found.camera.model.name}: focal length {found.camera.focal_px:.2f} px, centre "
        f"({x:.2f}, {y:.2f}) of {found.size[0]}x{found.size[1]} px",
        f"  error {chosen.fit.rms_px:.3f} px rms in {seen} of {len(found.views)} pictures; in "
        f"pictures left out of the fit {chosen.rms_px:.3f} px, at worst {chosen.worst_px:.3f} px",
        f"  corners reach {found.coverage.radius_px:.0f} px from the centre, of "
        f"{found.coverage.corner_px:.0f} px to the picture's corner; the distortion polynomial "
        f"fits the model to {found.radial.residual_px:.3f} px",
    ]


def _page(found: "Geometry") -> str:
    from camkit.report.pages.calibration.geometry_page import geometry_html

    return geometry_html(found)
