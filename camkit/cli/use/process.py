"""`camkit process`: captures in, pictures and sidecars out."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, DepthM, MaxErrorDb, MaxSeconds, Quality, whole_pair
from camkit.cli.exit_code import ExitCode
from camkit.cli.say import say
from camkit.cli.use.decoding_ahead import decoding_ahead
from camkit.cli.use.kind_options import with_kind_options
from camkit.errors import ContractError

Files = Annotated[list[str], typer.Argument(help="Captures, folders or globs.", metavar="FILES...")]


@with_kind_options
@decoding_ahead
def process(
    files: Files,
    bundle: Annotated[
        str | None,
        typer.Option(help="Bundle NAME or PATH; 'none' only develops. Default: the file's own."),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(help="Size of network, such as S, M, L. Default: the quality's."),
    ] = None,
    quality: Quality = "exact",
    max_seconds: MaxSeconds = None,
    max_error_db: MaxErrorDb = None,
    out_dir: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path(),
    keep_folders: Annotated[
        bool, typer.Option("--keep-folders", help="Pictures in folders as the captures are.")
    ] = False,
    format_: Annotated[
        str | None,
        typer.Option("--format", help="exr, tiff, png, jpeg (jpg) or dng. Default: exr."),
    ] = None,
    preview: Annotated[
        bool,
        typer.Option("--preview", help="Also a small tone-mapped NAME.preview.jpg (Drago 2003)."),
    ] = False,
    jpeg_quality: Annotated[
        int | None, typer.Option(help="With --format jpeg: 1..100. Default: 92.")
    ] = None,
    strip_metadata: Annotated[
        bool,
        typer.Option("--strip-metadata", help="Leave out camera, lens, date, exposure and place."),
    ] = False,
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
    black_level: Annotated[float | None, typer.Option(help="Black, DN, not the file's.")] = None,
    white_level: Annotated[float | None, typer.Option(help="White, DN, not the file's.")] = None,
    depth_m: DepthM = None,
    method: Annotated[
        str | None,
        typer.Option(
            help="Way of a stage: net, wiener, rl, admm-tv, develop; of photons log, lsq, linear."
        ),
    ] = None,
    mode: Annotated[str, typer.Option(help="exact, fast or whole.")] = "exact",
    unit: Annotated[
        Path | None, typer.Option(help="The camera body: a TOML of camkit freeze --unit.")
    ] = None,
    origin_px: Annotated[
        str | None, typer.Option(help="X,Y on the sensor of a crop that records no place.")
    ] = None,
    assume: Annotated[
        str | None, typer.Option(help="centre or scale, for a picture that is no full frame.")
    ] = None,
    force_bundle: Annotated[
        bool, typer.Option("--force-bundle", help="Also where a capture names another bundle.")
    ] = False,
    on_unsafe: Annotated[
        str,
        typer.Option(help="Outside the bundle's measured range: warn, fallback (Wiener) or fail."),
    ] = "warn",
    laws: Annotated[
        str,
        typer.Option(
            help="stated or enforce: keep the filter's brightness where no bundle bounds a network."
        ),
    ] = "stated",
    strength: Annotated[
        float, typer.Option(help="How much of what a network adds is kept, 0 to 1.")
    ] = 1.0,
    max_mem: Annotated[str | None, typer.Option(help="Memory cap, such as 2G or 900M.")] = None,
    threads: Annotated[int | None, typer.Option(help="Threads in all.")] = None,
    jobs: Annotated[int, typer.Option(help="Captures at once.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a dask scheduler, such as tcp://HOST:8786.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Worker processes of dask on this machine.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Skip what is proved done.")] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace pictures that exist.")
    ] = False,
    json_: Annotated[bool, typer.Option("--json", help="One JSON object per file.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the plan, do nothing.")] = False,
    _debug: Debug = False,
    **of_kind: str | None,
) -> None:
    """Turn captures into pictures through the camera's bundle."""
    from camkit.cli.use.cluster import cluster_client
    from camkit.cli.use.mosaic import mosaic_options
    from camkit.cli.use.results import print_result
    from camkit.runtime.batch import process as run
    from camkit.runtime.development import WriteOptions
    from camkit.runtime.options import Options, parse_memory, with_choices
    from camkit.runtime.unit import read_unit

    plain = Options(
        size=size,
        quality=quality,  # type: ignore[arg-type]
        max_seconds=max_seconds,
        max_error_db=max_error_db,
        depth_m=depth_m,
        method=method,
        mode=mode,  # type: ignore[arg-type]
        demosaic=demosaic,  # type: ignore[arg-type]
        color=color,  # type: ignore[arg-type]
        white_balance=_gains(wb),
        exposure_ev=exposure,
        vignetting=vignetting,
        undistort=undistort,
        origin_px=None if origin_px is None else whole_pair(origin_px, "--origin-px"),
        assume=assume,  # type: ignore[arg-type]
        force_bundle=force_bundle,
        on_unsafe=on_unsafe,  # type: ignore[arg-type]
        laws=laws,  # type: ignore[arg-type]
        strength=strength,
        max_mem_bytes=None if max_mem is None else parse_memory(max_mem),
        threads=threads,
        unit=None if unit is None else read_unit(unit),
    )
    options = with_choices(plain, of_kind)
    write = WriteOptions(
        out_dir=out_dir,
        keep_folders=keep_folders,
        format=format_,  # type: ignore[arg-type]
        preview=preview,
        linear=linear,
        jpeg_quality=jpeg_quality,
        strip_metadata=strip_metadata,
        resume=resume,
        overwrite=overwrite,
        jobs=jobs,
    )
    headerless = mosaic_options(mosaic, black_level, white_level)
    if dry_run:
        from camkit.cli.use.plan_text import print_plans

        done = print_plans(files, bundle, options, write, headerless, as_json=json_)
    else:
        with cluster_client(scheduler, workers, jobs) as client:
            results = run(
                files,
                bundle=bundle,
                options=options,
                write=write,
                mosaic=headerless,
                on_result=lambda result: print_result(result, as_json=json_),
                client=client,
                on_notice=lambda text: say(f"camkit: {text}", err=True),
            )
        done = all(result.status != "failed" for result in results) if results else None
    if done is None:
        say(f"camkit: no capture matches {', '.join(files)}", err=True)
        raise typer.Exit(ExitCode.NOTHING_MATCHED)
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
