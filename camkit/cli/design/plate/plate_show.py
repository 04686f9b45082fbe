"""`camkit plate show`: a plate on one page."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.design.plate.sensor import recipe_sensor
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.progress import working
from camkit.units import MM_PER_M


def show(
    plate: Annotated[
        Path,
        typer.Argument(
            help="Plate (.toml or built-in name), or bundle with a plate.", metavar="PLATE"
        ),
    ],
    recipe: Annotated[
        Path | None, typer.Option(help="Recipe (.toml) with the sensor; default: duet's.")
    ] = None,
    depth_m: Annotated[
        float | None,
        typer.Option(
            help="Distance of the point light in m ('inf' for infinity); default: the focus."
        ),
    ] = None,
    side_px: Annotated[int, typer.Option(help="Side of the window in px, odd.")] = 401,
    out_dir: Annotated[
        Path | None,
        typer.Option("-o", "--out-dir", help="Folder for NAME.html and its pictures (PNG, SVG)."),
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Draw and measure a plate: PSF, cuts, relief, where the light goes (needs torch).

    Without -o and --json the page NAME.html is written to the current folder.
    """
    from camkit.cli.design.design_time import refuse_existing, require_torch
    from camkit.report.judge_need import require_judge

    require_torch("camkit plate show")
    folder = out_dir if out_dir is not None or json_ else Path()
    if folder is not None:
        require_judge()
    from camkit.models_def.optics.diffraction.plate import read_plate
    from camkit.report.pages.page import page_path
    from camkit.report.pages.plate.plate_facts import Look, analyse, to_json
    from camkit.report.pages.plate.plate_page import write_plate_page

    if depth_m is not None and not depth_m > 0:
        raise ContractError(f"--depth-m must be > 0; got {depth_m:g}")
    if folder is not None:
        refuse_existing([page_path(folder, plate.stem)], overwrite=overwrite)
    depth_mm = None if depth_m is None else math.inf if math.isinf(depth_m) else depth_m * MM_PER_M
    look = Look(sensor=recipe_sensor(recipe), depth_mm=depth_mm, side_px=side_px)
    with working(f"measuring {plate}"):
        facts = analyse(read_plate(plate), look)
    with working("drawing the page"):
        written = [] if folder is None else write_plate_page(facts, folder, plate.stem)
    if json_:
        say(json.dumps(to_json(facts), allow_nan=False))
        return
    for path in written:
        say(str(path))
