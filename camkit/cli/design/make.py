"""`camkit make`: a camera from a lens and a sensor, in one command."""

import json
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
from camkit.stopwatch import Stopwatch


def make(
    context: typer.Context,
    optics: Annotated[
        Path,
        typer.Argument(
            help="Lens file (.toml, .zmx, .json), built-in name, or measured PSF (.safetensors).",
            metavar="LENS",
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="Bundle to write (.camkit).")],
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
    minutes: Annotated[
        float, typer.Option(help="CPU time in min for everything; 0 makes and judges the filter.")
    ] = 15.0,
    size: Annotated[str, typer.Option(help="Size of the network: S or M.")] = "S",
    name: Annotated[
        str | None, typer.Option(help="Name of the camera; default: that of the bundle.")
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(help="Folder of pictures to train on; default: procedural scenes."),
    ] = None,
    valid: Annotated[
        Path | None,
        typer.Option(help="Folder of pictures to judge by; default: procedural scenes."),
    ] = None,
    start: Annotated[
        Path, typer.Option(help="Bundle or checkpoint with the first weights of the network.")
    ] = Path("duet"),
    work_dir: Annotated[
        Path | None,
        typer.Option(help="Folder of the steps; default: NAME.work beside the bundle."),
    ] = None,
    workers: Annotated[int, typer.Option(help="Number of processes that make samples.")] = 1,
    judge: Annotated[
        bool,
        typer.Option(
            "--judge/--no-judge",
            help="Judge on captures and write the page; only 0 minutes can skip it.",
        ),
    ] = True,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Make a camera from a lens: PSF, filter, network, checks and a page (needs torch).

    The bundle is usable as soon as its filter is written; Ctrl-C then loses only network and
    page. After an interruption the same command repeats no finished step.
    """
    from camkit.models_def.face.recipe_writing import CameraWords
    from camkit.report.making.camera_making import make as make_camera

    camera = CameraWords(
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
    facts = make_camera(
        optics,
        output,
        camera=camera,
        minutes=minutes,
        size=size,
        name=name,
        data=data,
        valid=valid,
        start=start,
        work_dir=work_dir,
        workers=workers,
        judge=judge,
        overwrite=overwrite,
        on_note=lambda text: say(f"camkit make: {text}", err=True),
        stopwatch=context.find_object(Stopwatch),
    )
    if json_:
        say(json.dumps(facts))
        return
    if facts["page"] is None:
        say(f"{facts['bundle']}: its filter is not judged, and no page is written")
        return
    from camkit.report.making.camera_page import name_of

    decibels = ", ".join(f"{name_of(key)} {value:.2f}" for key, value in facts["psnr_db"].items())
    say(f"{facts['bundle']}: {decibels} dB; see {facts['page']}")
