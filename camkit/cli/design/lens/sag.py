"""`camkit lens sag`: the profile of a surface as a table for the workshop."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Configuration, Debug, GlassCatalogues, GlassFiles, Json, Overwrite
from camkit.cli.say import say


def sag(
    file: Annotated[Path, typer.Argument(help="Lens file (.toml, .zmx or .json).", metavar="FILE")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Table to write (.csv).")],
    surface: Annotated[
        int | None,
        typer.Option(
            min=0, help="Index of the surface, from 0; default: the first with grooves, else 0."
        ),
    ] = None,
    step_um: Annotated[float, typer.Option(min=0.1, help="Step of the radius in um.")] = 10.0,
    glass: GlassFiles = None,
    catalogue: GlassCatalogues = None,
    configuration: Configuration = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Write radius, height and slope of a surface from the axis to its rim (needs torch).

    At a wall of a groove there are two rows of one radius: the foot and the top.
    """
    from camkit.cli.design.design_time import refuse_existing, require_torch

    require_torch("camkit lens sag")
    refuse_existing([out], overwrite=overwrite)
    from camkit.errors import ContractError
    from camkit.models_def.optics.lens_file.lens_file import read_noted_lens
    from camkit.models_def.optics.thin.lens_sag import not_in_profiles
    from camkit.models_def.optics.thin.sag_table import sag_table, write_sag_table

    lens, notes = read_noted_lens(file, glass or (), catalogue, configuration)
    if surface is None:
        cut = (n for n, face in enumerate(lens.surfaces) if face.grooves is not None)
        surface = next(cut, 0)
    if surface >= len(lens.surfaces):
        raise ContractError(f"--surface must be 0..{len(lens.surfaces) - 1}; got {surface}")
    table = sag_table(lens.surfaces[surface], step_um)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_sag_table(table, out)
    for note in (*notes, *not_in_profiles(lens, [surface])):
        say(f"{file.name}: {note}", err=True)
    low, high = float(table.height_um.min()), float(table.height_um.max())
    steepest_deg = math.degrees(math.atan(float(abs(table.slope).max())))
    if json_:
        record = {"lens": lens.name, "surface": surface, "out": str(out)}
        record |= {"rows": len(table.radius_mm), "walls": table.walls}
        say(json.dumps(record | {"height_um": [low, high], "steepest_deg": steepest_deg}))
        return
    say(
        f"{out}: {len(table.radius_mm)} radii, {table.walls} walls, heights {low:.3f} to "
        f"{high:.3f} um, slopes to {steepest_deg:.2f} degrees"
    )
