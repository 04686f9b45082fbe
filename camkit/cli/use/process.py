"""`camkit process`: captures in, pictures and sidecars out."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import (
    Debug,
    DepthM,
    FrozenState,
    MaxErrorDb,
    MaxSeconds,
    Quality,
    whole_pair,
)
from camkit.cli.exit_code import ExitCode
from camkit.cli.say import say
from camkit.cli.use.decoding_ahead import decoding_ahead
from camkit.cli.use.kind_options import with_kind_options
from camkit.cli.use.mosaic import BlackLevel, MosaicCfa, WhiteLevel, mosaic_options
from camkit.errors import ContractError

Files = Annotated[
    list[str], typer.Argument(help="Captures, folders or glob patterns.", metavar="FILES...")
]


@with_kind_options
@decoding_ahead
def process(
    files: Files,
    bundle: Annotated[
        str | None,
        typer.Option(
            help="Camera bundle (NAME, PATH) or 'none' (develop; SPAD: own array); default: "
            "the capture's."
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(help="Network size, such as S, M or L; default: the size of --quality."),
    ] = None,
    quality: Quality = "exact",
    scale: Annotated[
        str,
        typer.Option(help="Size of the picture over the capture's: 1, 1/2 or 1/4, at its price."),
    ] = "1",
    max_seconds: MaxSeconds = None,
    max_error_db: MaxErrorDb = None,
    out_dir: Annotated[Path, typer.Option(help="Folder for pictures and sidecars.")] = Path(),
    keep_folders: Annotated[
        bool,
        typer.Option("--keep-folders", help="Repeat the folders of the captures below --out-dir."),
    ] = False,
    format_: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="File format: exr, tiff, png, jpeg (jpg) or dng; default: exr (SPAD: NPZ).",
        ),
    ] = None,
    preview: Annotated[
        bool,
        typer.Option(
            "--preview", help="Also write a small tone-mapped NAME.preview.jpg (Drago 2003)."
        ),
    ] = False,
    jpeg_quality: Annotated[
        int | None, typer.Option(help="JPEG quality, 1 to 100, with --format jpeg; default: 92.")
    ] = None,
    strip_metadata: Annotated[
        bool,
        typer.Option(
            "--strip-metadata", help="Omit the metadata: camera, lens, date, exposure and location."
        ),
    ] = False,
    color: Annotated[
        str,
        typer.Option(
            help="Colour space: rec709, acescg or camera; a DNG always has camera colour."
        ),
    ] = "rec709",
    wb: Annotated[
        str, typer.Option(help="White balance: camera, or gains R,G,B relative to green.")
    ] = "camera",
    exposure: Annotated[float, typer.Option(help="Exposure compensation in EV.")] = 0.0,
    demosaic: Annotated[
        str | None, typer.Option(help="Demosaicking: fast or quality; default: the bundle's.")
    ] = None,
    linear: Annotated[
        bool, typer.Option("--linear", help="Write TIFF and PNG linear, without the sRGB curve.")
    ] = False,
    vignetting: Annotated[
        bool, typer.Option(help="Correct vignetting (divide by relative illumination).")
    ] = True,
    undistort: Annotated[bool, typer.Option(help="Correct the lens distortion.")] = True,
    mosaic: MosaicCfa = None,
    black_level: BlackLevel = None,
    white_level: WhiteLevel = None,
    tone: Annotated[
        str | None,
        typer.Option(
            help="Tone curve of JPEG, TIFF, PNG: srgb, linear or FILE.toml; default: the file's.",
            metavar="CURVE",
        ),
    ] = None,
    halves: Annotated[
        str | None,
        typer.Option(
            help="What differs in the names of dual-pixel halves, such as _l,_r; their mean is "
            "the capture.",
            metavar="LEFT,RIGHT",
        ),
    ] = None,
    noise: Annotated[
        str | None,
        typer.Option(
            help="Noise of linear light, such as 5e-5,1e-8; default: as stated or measured.",
            metavar="SHOT,READ_VARIANCE",
        ),
    ] = None,
    iso: Annotated[
        float | None,
        typer.Option(help="ISO for the bundle's noise model; default: the file's."),
    ] = None,
    depth_m: DepthM = None,
    configuration: FrozenState = None,
    method: Annotated[
        str | None,
        typer.Option(
            help="Restoration: net, wiener, rl, admm-tv, develop; SPAD: log, lsq, linear; "
            "default: the best."
        ),
    ] = None,
    mode: Annotated[
        str,
        typer.Option(help="Tiling: exact, fast (smaller halo, small error) or whole (one window)."),
    ] = "exact",
    unit: Annotated[
        Path | None, typer.Option(help="Measured camera body (.toml of `camkit freeze --unit`).")
    ] = None,
    origin_px: Annotated[
        str | None,
        typer.Option(
            help="Position X,Y of a crop on the sensor in px; default: as recorded, else a full "
            "frame."
        ),
    ] = None,
    assume: Annotated[
        str | None,
        typer.Option(
            help="Placement of a picture that does not match the sensor size: centre or scale."
        ),
    ] = None,
    force_bundle: Annotated[
        bool,
        typer.Option(
            "--force-bundle", help="Use --bundle even if the capture names another bundle."
        ),
    ] = False,
    on_unsafe: Annotated[
        str,
        typer.Option(
            help="Action outside the bundle's measured range: warn, fallback (Wiener filter) or "
            "fail."
        ),
    ] = "warn",
    laws: Annotated[
        str,
        typer.Option(
            help="Brightness bound on the network: stated (if the bundle has one) or enforce "
            "(always)."
        ),
    ] = "stated",
    strength: Annotated[
        float, typer.Option(help="Share of the network's correction that is kept, 0 to 1.")
    ] = 1.0,
    provider: Annotated[
        str, typer.Option(help="What computes the network: cpu, cuda, tensorrt or openvino.")
    ] = "cpu",
    dtype: Annotated[
        str, typer.Option(help="Precision of the network: fp32, fp16 or bf16 (openvino alone).")
    ] = "fp32",
    max_mem: Annotated[
        str | None, typer.Option(help="Memory limit, such as 2G or 900M; default: 930M.")
    ] = None,
    threads: Annotated[
        int | None, typer.Option(help="Total number of threads; default: all available.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="Number of captures processed at once.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a dask scheduler, such as tcp://HOST:8786.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Number of dask worker processes to start on this machine.")
    ] = None,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Skip captures whose sidecar proves that they are done."),
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace existing pictures.")
    ] = False,
    json_: Annotated[bool, typer.Option("--json", help="Print one JSON object per file.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print the plan and write nothing.")
    ] = False,
    _debug: Debug = False,
    **of_kind: str | None,
) -> None:
    """Restore captures with the bundle of their camera and write the pictures.

    An option that names spad is for captures of single photons.
    """
    from camkit.cli.use.cluster import cluster_client
    from camkit.cli.use.results import print_result
    from camkit.runtime.batch import process as run
    from camkit.runtime.batch import unmatched_text
    from camkit.runtime.machine.memory import keep_memory_for_good
    from camkit.runtime.options import Options, parse_memory, read_noise, with_choices
    from camkit.runtime.signal.halves import read_halves
    from camkit.runtime.signal.tone_curve import read_tone
    from camkit.runtime.unit import read_unit
    from camkit.runtime.write_options import WriteOptions

    keep_memory_for_good()
    plain = Options(
        size=size,
        quality=quality,  # type: ignore[arg-type]
        scale=scale,  # type: ignore[arg-type]
        max_seconds=max_seconds,
        max_error_db=max_error_db,
        depth_m=depth_m,
        configuration=configuration,
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
        tone=None if tone is None else read_tone(tone),
        halves=None if halves is None else read_halves(halves),
        noise=None if noise is None else read_noise(noise),
        iso=iso,
        unit=None if unit is None else read_unit(unit),
        dtype=dtype,  # type: ignore[arg-type]
        provider=provider,  # type: ignore[arg-type]
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
        say(f"camkit: {unmatched_text(files)}", err=True)
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
