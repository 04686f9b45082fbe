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
    outputs = Outputs.checked(out, page, overwrite=overwrite, as_json=json_)
    measured = _measure(pictures, board, square_mm, focal_px)
    outputs.write(measured.to_record(), _lines(measured), lambda: _page(measured))


def _measure(
    pictures: list[Path], board: str | None, square_mm: float | None, focal_px: float | None
) -> "Geometry":
    from camkit.calibration.geometry.board import Board
    from camkit.calibration.geometry.corner_file import is_corner_file, read_corners
    from camkit.calibration.geometry.geometry import calibrate_corners, calibrate_geometry

    if not is_corner_file(pictures):
        if board is None:
            raise ContractError("--board is needed: COLUMNSxROWS of its inner corners, like 9x6")
        return calibrate_geometry(pictures, Board.read(board, square_mm), focal_px)
    corners = read_corners(pictures[0])
    stated_board = Board.read(str(corners.board) if board is None else board, square_mm)
    if str(stated_board) != str(corners.board):
        raise ContractError(
            f"{pictures[0]} holds corners of a board of {corners.board}, not {stated_board}"
        )
    if square_mm is not None:
        corners = replace(corners, board=stated_board)
    return calibrate_corners(corners, focal_px)


def _lines(facts: "Geometry") -> list[str]:
    x, y = facts.camera.centre_px
    boards = sum(view.corners is not None for view in facts.views)
    best = facts.chosen
    return [
        f"  {facts.camera.model.name}: focal length {facts.camera.focal_px:.2f} px, centre "
        f"({x:.2f}, {y:.2f}) of {facts.size[0]}x{facts.size[1]} px",
        f"  error {best.fit.rms_px:.3f} px rms in {boards} of {len(facts.views)} pictures; in "
        f"pictures left out of the fit {best.rms_px:.3f} px, at worst {best.worst_px:.3f} px",
        f"  corners reach {facts.coverage.radius_px:.0f} px from the centre, of "
        f"{facts.coverage.corner_px:.0f} px to the picture's corner; the distortion polynomial "
        f"fits the model to {facts.radial.residual_px:.3f} px",
    ]


def _page(facts: "Geometry") -> str:
    from camkit.report.calibration.geometry import geometry_sections
    from camkit.report.calibration.page import to_html

    return to_html("camkit calibrate geometry", geometry_sections(facts))
