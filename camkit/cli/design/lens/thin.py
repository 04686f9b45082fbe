"""`camkit lens thin`: a thin plate for a large field, solved from a recipe."""

import json
import time
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.design.lens.peak import PitchUm, ToolRadiusUm, WithWaves, measured
from camkit.cli.say import say
from camkit.progress import working


def thin(
    recipe: Annotated[
        Path,
        typer.Argument(help="Recipe (.toml), or the name of a built-in one.", metavar="RECIPE"),
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Lens file of the plate to write (.toml).")
    ],
    pitch_um: PitchUm = 5.96,
    waves: WithWaves = False,
    tool_radius_um: ToolRadiusUm = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Solve a thin plate and measure its images of points (needs torch)."""
    from camkit.cli.design.design_time import refuse_existing, require_torch

    require_torch("camkit lens thin")
    import torch

    # the arrays are small: more threads mostly wait for each other
    torch.set_num_threads(1)
    from camkit.errors import UnsupportedError
    from camkit.models_def.optics.lens_file.lens_file import ready_for_lens, write_lens
    from camkit.models_def.optics.thin.plate_lens import plate_lens
    from camkit.models_def.optics.thin.report import to_text, with_tool
    from camkit.models_def.optics.thin.solver import solve_plate
    from camkit.models_def.optics.thin.thin_recipe import find_thin_recipe
    from camkit.units import to_degrees

    if out.suffix.lower() != ".toml":
        raise UnsupportedError(f"grooves need a lens file that ends in .toml; got {out.name}")
    refuse_existing([out], overwrite=overwrite)
    ready_for_lens(out)
    plan = find_thin_recipe(recipe)
    began = time.process_time()
    with working("solving the plate"):
        solved = solve_plate(plan)
        lens = plate_lens(plan, solved)
    if tool_radius_um is not None:
        lens = with_tool(lens, tool_radius_um)
    seconds = time.process_time() - began
    write_lens(lens, out)
    record = measured(lens, lens.field_angles_rad, pitch_um, waves=waves)
    discs = solved.apertures
    record |= {
        "out": str(out),
        "cpu_seconds": round(seconds, 2),
        "virtual_aperture_radius_mm": discs.radius_mm,
        "virtual_apertures": [
            {
                "field_angle_deg": round(to_degrees(angle), 9),
                "centre_mm": centre,
                "image_height_mm": height,
                "spot_rms_um": rms,
            }
            for angle, centre, height, rms in zip(
                discs.field_angles_rad,
                discs.centres_mm,
                solved.heights_mm,
                solved.spot_rms_um,
                strict=True,
            )
        ],
    }
    if json_:
        say(json.dumps(record))
        return
    say(f"{out}: {lens.name}, solved in {seconds:.1f} CPU-seconds")
    say(to_text(record))
