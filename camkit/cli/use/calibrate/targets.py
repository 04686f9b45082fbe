"""`camkit calibrate targets`: what a display shows while a camera is measured on it."""

import json
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.cli.use.calibrate.folder import Folder
from camkit.cli.use.calibrate.outputs import Page, check_page, file_names

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
    check_page(page, overwrite=overwrite)
    from camkit.calibration.display.screen import Screen
    from camkit.calibration.display.targets import (
        LIST,
        draw_targets,
        levels_of_steps,
        plan_targets,
    )
    from camkit.calibration.geometry.board import Board
    from camkit.calibration.record import to_toml
    from camkit.report.calibration.targets_page import shrunk, targets_html
    from camkit.runtime.output.pixels import png_bytes

    paths = pictures or []
    settings = Screen.read(screen), Board.read(board), levels_of_steps(levels)
    folder = Folder.checked(out, (LIST,), (".",), overwrite=overwrite)
    planned = plan_targets(paths, *settings)
    names = [*(target.file for target in planned.targets), LIST]
    pages = [] if page is None else [str(page.absolute())]
    with folder.writing([*pages, *names]) as parts:
        small = []
        for part, codes in zip(parts[len(pages) :], draw_targets(planned, paths), strict=False):
            part.write_bytes(png_bytes(codes))
            if pages:
                small.append(shrunk(codes))
        parts[-1].write_text(to_toml(planned.to_record()), encoding="utf-8")
        if pages:
            parts[0].write_text(targets_html(planned, small), encoding="utf-8")
    if json_:
        files = {"out": str(out), **({} if page is None else {"page": str(page)})}
        say(json.dumps({**planned.to_record(), **files}))
        return
    kinds = [target.kind for target in planned.targets]
    say(f"{file_names(out, page)}: {len(kinds)} targets of {planned.screen} px")
    say(
        f"  a board of {planned.board} corners, {kinds.count('grey')} grey steps, "
        f"{kinds.count('colour')} colours, {kinds.count('picture')} pictures"
    )
