"""`camkit merge`: a bracket of exposures to one linear EXR."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.errors import ContractError

if TYPE_CHECKING:
    from camkit.runtime.merging.response import ResponseName

Times = Annotated[
    str | None,
    typer.Option(
        help="Exposure times: seconds separated by commas in the order of FILES, or a file with "
        "lines NAME SECONDS; default: what the files state."
    ),
]
MosaicCfa = Annotated[
    str | None, typer.Option("--mosaic", help="FILES are headerless mosaics, such as RGGB.")
]
BlackLevel = Annotated[
    float | None, typer.Option(help="Of a headerless mosaic, or in place of a RAW file's.")
]
WhiteLevel = Annotated[
    float | None, typer.Option(help="Of a headerless mosaic, or in place of a RAW file's.")
]


def merge(
    files: Annotated[list[Path], typer.Argument(help="The frames: RAW, or pictures.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="The EXR to write.")],
    times: Times = None,
    response: Annotated[
        str | None,
        typer.Option(
            help="What codes stand for: linear, srgb or estimate; default: estimate for 8-bit "
            "pictures, linear for all else."
        ),
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(help="Name of the frame whose white is 1.0; default: the middle exposure."),
    ] = None,
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Merge frames of different exposure, each sample weighted by its noise, to a linear EXR."""
    if out.suffix.lower() != ".exr":
        raise ContractError(f"a merged picture is an EXR; expected a name in .exr, got {out}")
    if out.exists() and not overwrite:
        raise ContractError(f"{out} exists; say --overwrite or another name")
    from camkit.cli.use.mosaic import mosaic_options
    from camkit.runtime.merging.result import merge_to_exr
    from camkit.runtime.merging.survey import survey
    from camkit.runtime.merging.times import stated_times

    chosen = _response(response)
    said = mosaic_options(mosaic, black_level, white_level)
    bracket = survey(files, None if times is None else stated_times(times, files), mosaic=said)
    out.parent.mkdir(parents=True, exist_ok=True)
    report = merge_to_exr(bracket, out, response=chosen, reference=reference)
    if json_:
        say(json.dumps({**report.to_json(), "out": str(out)}))
        return
    for note in report.notes:
        say(f"note: {note}", err=True)
    say(
        f"{out}: {len(report.frames)} frames, {report.times_s[-1]:g} to {report.times_s[0]:g} s, "
        f"response {report.response}, {report.range_stops:.1f} stops, "
        f"{report.clipped_fraction:.4%} clipped in all; 1.0 is the white of {report.reference}"
    )


def _response(name: str | None) -> "ResponseName | None":
    match name:
        case None | "linear" | "srgb" | "estimate":
            return name
    raise ContractError(f"--response must be linear, srgb or estimate; got {name!r}")
