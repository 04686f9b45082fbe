"""`camkit calibrate noise`: pairs of dark and flat frames to gain and read noise of every ISO."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.outputs import Out, Outputs, Page
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options
from camkit.errors import ContractError

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
    outputs = Outputs.checked(out, page, overwrite=overwrite, as_json=json_)
    if iso is not None and not 0 < iso < float("inf"):
        raise ContractError(f"--iso must be > 0; got {iso:g}")
    from camkit.calibration.noise.sensor_noise import measure_sensor

    sensor = measure_sensor(dark, flat, mosaic_options(mosaic, black_level, white_level), iso)

    def html() -> str:
        from camkit.report.calibration.noise_page import noise_html

        return noise_html(sensor)

    outputs.write(sensor.to_record(), [_line(facts) for facts in sensor.isos], html)


def _line(facts: "IsoFacts") -> str:
    bound = "" if facts.read.resolved else "below "
    return (
        f"  ISO {facts.iso:g}: {facts.gain_e_per_dn:.4g} e-/DN ({100 * facts.gain_error:.2g} %), "
        f"read noise {bound}{facts.read_noise_e:.3g} e-, PRNU {100 * facts.prnu:.2g} %, "
        f"{facts.pairs} levels"
    )
