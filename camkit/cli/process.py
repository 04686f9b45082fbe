"""`camkit process`: captures in, pictures and sidecars out."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug
from camkit.cli.exit_code import ExitCode
from camkit.errors import BundleError, CamkitError, ContractError

if TYPE_CHECKING:
    from camkit.runtime.capture import MosaicOptions
    from camkit.runtime.development import WriteOptions
    from camkit.runtime.options import Options
    from camkit.runtime.pipeline import Pipeline

Files = Annotated[list[str], typer.Argument(help="Captures, folders or globs.", metavar="FILES...")]


def process(
    files: Files,
    bundle: Annotated[
        str | None,
        typer.Option(help="Bundle NAME or PATH; 'none' only develops. Default: the file's own."),
    ] = None,
    size: Annotated[str, typer.Option(help="Size of the network: S, M or L.")] = "M",
    out_dir: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path(),
    format_: Annotated[str, typer.Option("--format", help="exr, tiff, png or dng.")] = "exr",
    color: Annotated[
        str, typer.Option(help="rec709, acescg or camera; a DNG is camera.")
    ] = "rec709",
    wb: Annotated[str, typer.Option(help="'camera' or gains R,G,B.")] = "camera",
    exposure: Annotated[float, typer.Option(help="Exposure in EV.")] = 0.0,
    demosaic: Annotated[
        str | None, typer.Option(help="fast or quality; default: the bundle's.")
    ] = None,
    linear: Annotated[bool, typer.Option("--linear", help="TIFF and PNG without curve.")] = False,
    vignetting: Annotated[bool, typer.Option(help="Divide by relative illumination.")] = True,
    undistort: Annotated[bool, typer.Option(help="Undo the lens's distortion.")] = True,
    mosaic: Annotated[
        str | None, typer.Option(help="Headerless mosaic: RGGB, BGGR, GRBG or GBRG.")
    ] = None,
    black_level: Annotated[float | None, typer.Option(help="With --mosaic: black, DN.")] = None,
    white_level: Annotated[float | None, typer.Option(help="With --mosaic: white, DN.")] = None,
    method: Annotated[str, typer.Option(help="net, wiener, rl or admm-tv.")] = "net",
    mode: Annotated[str, typer.Option(help="exact, fast or whole.")] = "exact",
    assume: Annotated[
        str | None, typer.Option(help="centre or scale, for a picture that is no full frame.")
    ] = None,
    max_mem: Annotated[str | None, typer.Option(help="Memory cap, such as 2G or 900M.")] = None,
    threads: Annotated[int | None, typer.Option(help="Threads in all.")] = None,
    jobs: Annotated[int, typer.Option(help="Captures at once.")] = 1,
    resume: Annotated[bool, typer.Option("--resume", help="Skip what is proved done.")] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace pictures that exist.")
    ] = False,
    json_: Annotated[bool, typer.Option("--json", help="One JSON object per file.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the plan, do nothing.")] = False,
    _debug: Debug = False,
) -> None:
    """Turn captures into pictures through the camera's bundle."""
    from camkit.cli.mosaic import mosaic_options
    from camkit.cli.progress import TileProgress
    from camkit.runtime.batch import expand
    from camkit.runtime.batch import process as run
    from camkit.runtime.development import WriteOptions
    from camkit.runtime.options import Options, parse_memory

    options = Options(
        size=size,
        method=method,  # type: ignore[arg-type]  # checked by Options
        mode=mode,  # type: ignore[arg-type]
        demosaic=demosaic,  # type: ignore[arg-type]
        color=color,  # type: ignore[arg-type]
        white_balance=_gains(wb),
        exposure_ev=exposure,
        vignetting=vignetting,
        undistort=undistort,
        assume=assume,  # type: ignore[arg-type]
        max_mem_bytes=None if max_mem is None else parse_memory(max_mem),
        threads=threads,
    )
    write = WriteOptions(
        out_dir=out_dir,
        format=format_,  # type: ignore[arg-type]
        linear=linear,
        resume=resume,
        overwrite=overwrite,
        jobs=jobs,
    )
    sources = expand(files)
    if not sources:
        typer.echo(f"camkit: no capture matches {', '.join(files)}", err=True)
        raise typer.Exit(ExitCode.NOTHING_MATCHED)
    headerless = mosaic_options(mosaic, black_level, white_level)
    if dry_run:
        done = _print_plans(sources, bundle, options, write, headerless, as_json=json_)
    else:
        with TileProgress() as progress:
            results = run(
                sources,
                bundle=bundle,
                options=options,
                write=write,
                mosaic=headerless,
                progress=progress.tile,
                on_result=lambda result: progress.result(result, as_json=json_),
            )
        done = all(result.status != "failed" for result in results)
    if not done:
        raise typer.Exit(ExitCode.INPUT_FAILED)


def _gains(text: str) -> tuple[float, float, float] | None:
    """Read --wb: None for the camera's own gains, else (R, G, B) with G = 1."""
    if text == "camera":
        return None
    try:
        r, g, b = (float(part) for part in text.split(","))
    except ValueError:
        raise ContractError(f"--wb takes 'camera' or three gains R,G,B; got {text!r}") from None
    if not g > 0:
        raise ContractError(f"--wb gains must be > 0; got {text!r}")
    return r / g, 1.0, b / g


def _print_plans(
    sources: list[Path],
    bundle: str | None,
    options: "Options",
    write: "WriteOptions",
    headerless: "MosaicOptions | None",
    *,
    as_json: bool,
) -> bool:
    """Say what would be done with every input; give whether all of it could be."""
    from camkit.runtime.batch import plan_tasks
    from camkit.runtime.pipeline import load
    from camkit.runtime.raw import read_capture

    made: dict[str, Pipeline] = {}
    done = True
    for task in plan_tasks(sources, bundle=bundle, write=write):
        facts: dict[str, object] = {"input": str(task.source), "output": str(task.target)}
        try:
            if task.refusal is not None:
                raise ContractError(task.refusal)
            if task.bundle not in made:
                made[task.bundle] = load(task.bundle, options=options)
            work = made[task.bundle].start(read_capture(task.source, mosaic=headerless))
            facts |= {"status": "planned", "bundle": task.bundle, "plan": work.plan}
            facts["warnings"] = list(work.warnings)
        except CamkitError as error:
            if bundle is not None and isinstance(error, BundleError):
                raise
            facts |= {"status": "failed", "error": str(error)}
            done = False
        typer.echo(json.dumps(facts) if as_json else _lines(facts))
    return done


def _lines(facts: dict[str, object]) -> str:
    return "\n".join(f"{key}: {value}" for key, value in facts.items())
