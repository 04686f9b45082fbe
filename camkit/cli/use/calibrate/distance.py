"""`camkit calibrate distance`: two pictures of one plane to what the distances count from."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Configuration, Debug, GlassCatalogues, GlassFiles, Json, Overwrite
from camkit.cli.design.camera_options import FNumber, StopRadiusMm, distances_m
from camkit.cli.use.calibrate.calibration_outputs import print_result

if TYPE_CHECKING:
    from camkit.calibration.blur_pair.distance_facts import DistanceFacts


def distance(
    pictures: Annotated[
        list[Path],
        typer.Argument(
            help="A wide, blurred picture and a sharp one of a plane; more planes follow."
        ),
    ],
    lens: Annotated[Path, typer.Option(help="Lens file (.toml, .zmx, .json) or built-in name.")],
    focus_m: Annotated[
        float, typer.Option(help="Distance in m ('inf' for infinity) that the lens is focused on.")
    ],
    object_m: Annotated[
        str, typer.Option(help="Distance of the plane in m, or of each plane, such as 0.6,1.5.")
    ],
    *,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Also write the result (.toml).")
    ] = None,
    f_number: FNumber = None,
    stop_radius_mm: StopRadiusMm = None,
    sharp_f_number: Annotated[
        float | None, typer.Option(help="F-number of the sharp picture, counted the same way.")
    ] = None,
    sharp_stop_radius_mm: Annotated[
        float | None, typer.Option(help="Radius of the stop of the sharp picture in mm.")
    ] = None,
    sensor: Annotated[
        str | None,
        typer.Option(help="Sensor as WIDTHxHEIGHT@PITCHum, such as 768x512@46.9um, or a name."),
    ] = None,
    pitch_um: Annotated[
        float | None, typer.Option(help="Pixel pitch in um; default: as the pictures state.")
    ] = None,
    tone: Annotated[
        list[Path] | None,
        typer.Option(
            help="Tone curve: srgb, linear or a file of `calibrate tone`; repeat to compare."
        ),
    ] = None,
    halves: Annotated[
        str | None,
        typer.Option(
            help="What differs in the names of dual-pixel halves, such as _l,_r.",
            metavar="LEFT,RIGHT",
        ),
    ] = None,
    distance_from: Annotated[
        str | None,
        typer.Option(help="Known origin: vertex, sensor or pupil; default: all are compared."),
    ] = None,
    glass: GlassFiles = None,
    catalogue: GlassCatalogues = None,
    configuration: Configuration = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Find a lens's distance origin, its defocus and the tone curve of pictures (needs torch).

    The sharp picture is blurred as the traced lens would, and compared with the wide one.
    """
    from camkit.calibrate import lens_distance
    from camkit.calibrate.pair_words import PairWords
    from camkit.runtime.signal.halves import read_halves

    words = PairWords(
        focus_m=focus_m,
        object_m=distances_m(object_m),
        f_number=f_number,
        stop_radius_mm=stop_radius_mm,
        sharp_f_number=sharp_f_number,
        sharp_stop_radius_mm=sharp_stop_radius_mm,
        sensor=sensor,
        pitch_um=pitch_um,
        distance_from=distance_from,
        glass=tuple(glass or ()),
        catalogue=catalogue,
        configuration=configuration,
    )
    facts = lens_distance.distance(
        pictures,
        lens,
        out,
        words=words,
        tones=tuple(tone or ()),
        halves=None if halves is None else read_halves(halves),
        overwrite=overwrite,
    )
    record = facts.to_record()
    if out is not None:
        record["out"] = str(out)
    print_result(record, _lines(facts), as_json=json_, summary=facts.sentence)


def _lines(facts: "DistanceFacts") -> list[str]:
    header = f"  {'blur':<18} {'fitted':<27}    dB  red green  blue  centre corner"
    lines = [header]
    for row in facts.rows:
        colours = " ".join(f"{row.errors.psnr_db(colour=c):5.2f}" for c in range(3))
        zones = "  ".join(f"{row.errors.psnr_db(zone=zone):5.2f}" for zone in (0, 2))
        lines.append(
            f"  {row.name:<18} {row.setting:<27} {row.errors.psnr_db():5.2f} {colours}  {zones}"
        )
    options = " ".join(
        f"--{name.replace('_', '-')} {value}" for name, value in facts.options.items()
    )
    where = "" if facts.is_sure else " (not sure: for this distance alone)"
    return [*lines, f"  for camkit make{where}: {options}"]
