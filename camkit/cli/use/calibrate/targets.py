"""`camkit calibrate targets`: what a display shows while a camera is measured on it."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Page, print_result, with_files

LEVELS = "0,16,32,48,64,96,128,160,192,224,255"


def targets(
    screen: Annotated[str, typer.Option(help="Size of the display in px, WIDTHxHEIGHT.")],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder for the PNG files and their list.")
    ],
    pictures: Annotated[
        list[Path] | None, typer.Argument(help="Sharp pictures to show, sRGB or Adobe RGB.")
    ] = None,
    board: Annotated[
        str, typer.Option(help="Inner corners of the checkerboard, COLUMNSxROWS.")
    ] = "9x6",
    levels: Annotated[str, typer.Option(help="Levels of the grey steps, 0 to 255.")] = LEVELS,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Write pictures for a display: checkerboard, grey steps, colours, pictures with marks."""
    from camkit.calibrate import displays

    plan = displays.targets(
        screen,
        out,
        pictures or (),
        board=board,
        levels=levels,
        page=page,
        overwrite=overwrite,
    )
    kinds = [target.kind for target in plan.targets]
    line = (
        f"  a board of {plan.board} corners, {kinds.count('grey')} grey steps, "
        f"{kinds.count('colour')} colours, {kinds.count('picture')} pictures"
    )
    record = with_files(plan.to_record(), out, page)
    summary = f"{len(kinds)} targets of {plan.screen} px"
    print_result(record, [line], as_json=json_, summary=summary)
