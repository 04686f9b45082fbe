"""`camkit calibrate tone`: pictures of grey steps to the tone curve of a display."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.calibration_outputs import Out, Page, print_result, with_files
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options


def tone(
    files: Annotated[
        list[Path], typer.Argument(help="Linear pictures, each of one grey that fills the display.")
    ],
    levels: Annotated[
        str,
        typer.Option(help="Levels sent to the display, such as 0,16,255, in the order of FILES."),
    ],
    out: Out,
    page: Page = None,
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Measure the luminance of a display at each of its levels."""
    from camkit.calibrate import displays

    facts = displays.tone(
        files,
        levels,
        out,
        mosaic=mosaic_options(mosaic, black_level, white_level),
        page=page,
        overwrite=overwrite,
    )
    record = facts.to_record()
    line = f"  {len(files)} steps, black {facts.luminance[0]:.3g} of the brightest"
    if record["gamma"] is not None:
        line += f", gamma {record['gamma']:.3g} to {record['residual_percent']:.2g} %"
    print_result(with_files(record, out, page), [line], as_json=json_)
