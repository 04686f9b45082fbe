"""`camkit calibrate noise`: pairs of dark and flat frames to gain and read noise of every ISO."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Out, Page, print_result, with_files
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options

if TYPE_CHECKING:
    from camkit.calibration.noise.sensor_noise import IsoFacts


def noise(
    dark: Annotated[
        list[Path],
        typer.Option(help="Dark frame, two per ISO; repeat the option for every frame."),
    ],
    flat: Annotated[
        list[Path],
        typer.Option(
            help="Evenly lit frame, two per level, two levels or more per ISO; repeat for every "
            "frame."
        ),
    ],
    out: Out,
    page: Page = None,
    iso: Annotated[
        float | None, typer.Option(help="ISO speed of files that state none.", show_default=False)
    ] = None,
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Measure gain, read noise and fixed patterns of a sensor from pairs of RAW frames."""
    from camkit.calibrate import photographs

    facts = photographs.noise(
        dark,
        flat,
        out,
        iso=iso,
        mosaic=mosaic_options(mosaic, black_level, white_level),
        page=page,
        overwrite=overwrite,
    )
    lines = [_line(one) for one in facts.isos]
    print_result(with_files(facts.to_record(), out, page), lines, as_json=json_)


def _line(facts: "IsoFacts") -> str:
    bound = "" if facts.read.resolved else "below "
    return (
        f"  ISO {facts.iso:g}: {facts.gain_e_per_dn:.4g} e-/DN ({100 * facts.gain_error:.2g} %), "
        f"read noise {bound}{facts.read_noise_e:.3g} e-, PRNU {100 * facts.prnu:.2g} %, "
        f"{facts.pairs} levels"
    )
