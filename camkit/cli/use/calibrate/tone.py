"""`camkit calibrate tone`: pictures of grey steps to the tone curve of a display."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.outputs import Out, Outputs, Page
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
    outputs = Outputs.checked(out, page, overwrite=overwrite, as_json=json_)
    from camkit.calibration.tone import levels_of, measure_tone

    mosaic_facts = mosaic_options(mosaic, black_level, white_level)
    facts = measure_tone(files, levels_of(levels, len(files)), mosaic_facts)

    def html() -> str:
        from camkit.report.calibration.tone_page import tone_html

        return tone_html(facts)

    record = facts.to_record()
    line = f"  {len(files)} steps, black {facts.luminance[0]:.3g} of the brightest"
    if record["gamma"] is not None:
        line += f", gamma {record['gamma']:.3g} to {record['residual_percent']:.2g} %"
    outputs.write(record, [line], html)
