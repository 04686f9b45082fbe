"""`camkit recipe`: the training recipe of a lens before a sensor."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Configuration, Debug, GlassCatalogues, GlassFiles, Json, Overwrite
from camkit.cli.design.camera_options import (
    VERTEX,
    DefocusMm,
    DistanceFrom,
    FNumber,
    FocusM,
    ObjectM,
    Photo,
    PitchUm,
    SensorText,
    StopRadiusMm,
    distances_m,
)
from camkit.cli.say import say
from camkit.units import MM_PER_M


def recipe(
    lens: Annotated[
        Path,
        typer.Argument(
            help="Lens file (.toml, .zmx, .json), built-in name, or measured PSF (.safetensors).",
            metavar="LENS",
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="Recipe to write (.toml).")],
    *,
    sensor: SensorText = None,
    photo: Photo = None,
    pitch_um: PitchUm = None,
    f_number: FNumber = None,
    stop_radius_mm: StopRadiusMm = None,
    focus_m: FocusM = None,
    object_m: ObjectM = None,
    distance_from: DistanceFrom = VERTEX,
    defocus_mm: DefocusMm = 0.0,
    glass: GlassFiles = None,
    catalogue: GlassCatalogues = None,
    configuration: Configuration = None,
    name: Annotated[
        str | None, typer.Option(help="Name of the camera; default: that of the recipe.")
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Write a camera's recipe with every default, and the lens as used beside it (needs torch)."""
    from camkit.models_def.face import recipe_writing

    camera = recipe_writing.CameraWords(
        sensor=sensor,
        photo=photo,
        pitch_um=pitch_um,
        f_number=f_number,
        stop_radius_mm=stop_radius_mm,
        focus_m=focus_m,
        object_m=distances_m(object_m),
        distance_from=distance_from,
        defocus_mm=defocus_mm,
        glass=tuple(glass or ()),
        catalogue=catalogue,
        configuration=configuration,
    )
    facts = recipe_writing.recipe(lens, output, camera=camera, name=name, overwrite=overwrite)
    if json_:
        say(json.dumps(facts))
        return
    for note in facts["notes"]:
        say(f"{lens.name}: {note}", err=True)
    if facts["defaults"]:
        say(f"defaults of the sensor, not facts: {', '.join(facts['defaults'])}", err=True)
    size = "{width_px}x{height_px} of {pixel_pitch_um:g} um".format(**facts["sensor"])
    optics = "a measured PSF"
    if "efl_mm" in facts:
        optics = f"{facts['efl_mm']:.4g} mm F/{facts['f_number']:.3g}"
    focus_m = facts["focus_mm"] / MM_PER_M
    focus = f"on {focus_m:.4g} m" if math.isfinite(focus_m) else "at infinity"
    say(f"{facts['recipe']}, {facts['lens']}: {optics} on {size}, focused {focus}")
