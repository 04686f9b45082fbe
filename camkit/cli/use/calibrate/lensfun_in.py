"""`camkit calibrate lensfun-in`: a lens of lensfun's database to a bundle of an ordinary camera."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Page, print_result, with_files
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options

if TYPE_CHECKING:
    from camkit.calibration.lensfun.profile import LensfunProfile


def lensfun_in(
    database: Annotated[
        Path, typer.Argument(help="Folder of a lensfun database, or one of its XML files.")
    ],
    lens: Annotated[str, typer.Option(help="Model of the lens, as written in the database.")],
    focal_mm: Annotated[float, typer.Option(help="Focal length of the captures in mm.")],
    capture: Annotated[
        Path, typer.Option(help="Example capture; the bundle fits captures like it.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Bundle to write (.camkit).")],
    aperture: Annotated[
        float | None,
        typer.Option(help="F-number for the vignetting; default: as the capture states."),
    ] = None,
    distance_m: Annotated[
        float | None, typer.Option(help="Object distance in m for the vignetting; default: far.")
    ] = None,
    crop_factor: Annotated[
        float | None,
        typer.Option(
            help="Crop factor of the sensor; default: from the pixel pitch, else the camera's."
        ),
    ] = None,
    scale: Annotated[
        float | None,
        typer.Option(
            help="Scale of the corrected picture; default: the largest up to 1 without repeated "
            "borders."
        ),
    ] = None,
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Make a bundle that corrects distortion and vignetting of a lens from a lensfun database."""
    from camkit.calibrate import camera_bundles

    bundle = camera_bundles.lensfun_in(
        database,
        lens,
        focal_mm,
        capture,
        out,
        aperture=aperture,
        distance_m=distance_m,
        crop_factor=crop_factor,
        scale=scale,
        mosaic=mosaic_options(mosaic, black_level, white_level),
        page=page,
        overwrite=overwrite,
    )
    record = with_files(bundle.to_record(), out, page)
    print_result(record, [_line(bundle.profile)], as_json=json_)


def _line(profile: "LensfunProfile") -> str:
    entry, light = profile.distortion, profile.vignetting
    evened = "" if light is None else f", light evened as at f/{light.aperture:g}"
    return f"  {profile.lens.name}, {entry.model} at {entry.focal_mm:g} mm{evened}"
