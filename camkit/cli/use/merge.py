"""`camkit merge`: a bracket of exposures to one linear EXR."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.exit_code import ExitCode
from camkit.cli.say import say
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options
from camkit.errors import CamkitError, ContractError
from camkit.progress import counted

if TYPE_CHECKING:
    from camkit.runtime.merging.response import ResponseName
    from camkit.runtime.merging.result import Report

Times = Annotated[
    str | None,
    typer.Option(
        help="Exposure times in s, such as 1,0.5, or a file of NAME SECONDS; default: from "
        "the files."
    ),
]


def merge(
    files: Annotated[
        list[Path],
        typer.Argument(help="Frames of one bracket (RAW or pictures), or one folder per bracket."),
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="EXR to write; for several brackets a folder.")
    ],
    times: Times = None,
    response: Annotated[
        str | None,
        typer.Option(
            help="Response curve: linear, srgb or estimate; default: estimate for 8 bits, else "
            "linear."
        ),
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(
            help="Name of the frame whose white level is 1.0; default: the middle exposure."
        ),
    ] = None,
    preview: Annotated[
        bool,
        typer.Option(
            "--preview", help="Also write a small tone-mapped OUT.preview.jpg (Drago 2003)."
        ),
    ] = False,
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Merge exposures into one linear EXR, each sample weighted by its noise.

    --times takes seconds separated by commas in the order of FILES, or a file with lines
    NAME SECONDS, which may lie in each folder.
    """
    from camkit.runtime.merging.brackets import find_brackets, merged_paths
    from camkit.runtime.merging.result import merge_to_exr
    from camkit.runtime.merging.survey import survey
    from camkit.runtime.output.preview_file import preview_path

    response_name = _response(response)
    mosaic_facts = mosaic_options(mosaic, black_level, white_level)
    brackets = find_brackets(files)
    outs = merged_paths(brackets, out)
    previews = [preview_path(path) if preview else None for path in outs]
    for path in (*outs, *filter(None, previews)):
        if path.exists() and not overwrite:
            raise ContractError(f"{path} exists; add --overwrite or choose another name")
    failed = False
    jobs = list(zip(brackets, outs, previews, strict=True))
    for bracket, path, preview_out in counted(jobs, "merging", "brackets"):
        try:
            frames = survey(bracket.files, bracket.times_s(times), mosaic=mosaic_facts)
            path.parent.mkdir(parents=True, exist_ok=True)
            report = merge_to_exr(
                frames, path, response=response_name, reference=reference, preview=preview_out
            )
        except (CamkitError, OSError) as error:
            if len(brackets) == 1:
                raise
            say(f"camkit: {bracket.folder}: {error}", err=True)
            failed = True
            continue
        _print(report, path, preview_out, json_=json_)
    if failed:
        raise typer.Exit(ExitCode.INPUT_FAILED)


def _print(report: "Report", out: Path, preview: Path | None, *, json_: bool) -> None:
    if json_:
        extra = {} if preview is None else {"preview": str(preview)}
        say(json.dumps({**report.to_json(), "out": str(out), **extra}))
        return
    for note in report.notes:
        say(f"note: {note}", err=True)
    preview_text = "" if preview is None else f", {preview}"
    say(
        f"{out}{preview_text}: {len(report.frames)} frames, {report.times_s[-1]:g} to "
        f"{report.times_s[0]:g} s, response {report.response}, {report.range_stops:.1f} stops, "
        f"{report.clipped_fraction:.4%} clipped in all; 1.0 is the white of {report.reference}"
    )


def _response(name: str | None) -> "ResponseName | None":
    match name:
        case None | "linear" | "srgb" | "estimate":
            return name
    raise ContractError(f"--response must be linear, srgb or estimate; got {name!r}")
