"""`camkit bench`: speed against accuracy, as a table, a chart and a page."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json
from camkit.cli.say import say
from camkit.errors import ContractError
from camkit.progress import working

if TYPE_CHECKING:
    from camkit.report.bench.row import Row
    from camkit.report.bench.settings import Settings


def bench(
    bundles: Annotated[
        list[str] | None, typer.Argument(help="Bundle NAMEs or PATHs.", metavar="[BUNDLE]...")
    ] = None,
    all_: Annotated[
        bool,
        typer.Option(
            "--all", help="Use all built-in cameras that photograph and state a sensor size."
        ),
    ] = False,
    data: Annotated[
        Path | None,
        typer.Option(help="Folder of sharp pictures, also EXR and HDR; default: the golden cases."),
    ] = None,
    saturate: Annotated[
        float | None,
        typer.Option(
            help="Share of pixels to saturate by exposure, such as 0.015; default: as they are."
        ),
    ] = None,
    nits_per_unit: Annotated[
        float | None,
        typer.Option(help="Luminance of white in cd/m^2, for HDR metrics; default: 39.0625."),
    ] = None,
    images: Annotated[
        int | None, typer.Option(help="Number of pictures to use; default: all.")
    ] = None,
    out_dir: Annotated[Path, typer.Option(help="Folder for table, chart and page.")] = Path(
        "bench"
    ),
    sizes: Annotated[
        str | None, typer.Option(help="Network sizes, such as S,M,L; default: all.")
    ] = None,
    methods: Annotated[
        str | None, typer.Option(help="Methods, such as net,wiener,develop; default: all.")
    ] = None,
    modes: Annotated[
        str | None,
        typer.Option(help="Tiling modes of exact,fast,whole; default: all for size M, else exact."),
    ] = None,
    dtypes: Annotated[
        str | None,
        typer.Option(
            help="Precisions of fp32,fp16,bf16; default: the first two for size M, else fp32."
        ),
    ] = None,
    providers: Annotated[
        str | None,
        typer.Option(
            help="Providers of cpu,cuda,tensorrt,openvino; default: all present for size M, "
            "else cpu."
        ),
    ] = None,
    threads: Annotated[
        str | None,
        typer.Option(help="Thread counts, such as 1,2; default: all threads, for size M also 1."),
    ] = None,
    tile: Annotated[
        str | None, typer.Option(help="Tile sides in px, such as 256,512; default: as planned.")
    ] = None,
    reference: Annotated[
        list[str] | None,
        typer.Option(help="Another bundle of the same camera to compare with; may be repeated."),
    ] = None,
    capture: Annotated[
        Path | None, typer.Option(help="Capture to time; default: a procedural one.")
    ] = None,
    photo: Annotated[
        Path | None,
        typer.Option(help="Sharp picture that every camera photographs for the timing."),
    ] = None,
    width: Annotated[
        int | None,
        typer.Option(help="Width of the procedural capture in px; default: the sensor's."),
    ] = None,
    height: Annotated[
        int | None,
        typer.Option(help="Height of the procedural capture in px; default: the sensor's."),
    ] = None,
    repeat: Annotated[
        int | None, typer.Option(help="Processes per row; default: 3, or 2 with --quick.")
    ] = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Use a small capture, few rows and two processes per row."),
    ] = False,
    work_dir: Annotated[
        Path | None,
        typer.Option(
            help="Folder that keeps captures and traced PSFs; default: a temporary folder."
        ),
    ] = None,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Measure speed and accuracy of bundles and of classical methods, as table, chart and page."""
    from camkit.report.bench.settings import (
        DEFAULT_REPEAT,
        QUICK_METHODS,
        Settings,
    )
    from camkit.report.bench.trial import Axes

    names = [*(bundles or ()), *(_cameras() if all_ else ())]
    axes = Axes(
        sizes=_words(sizes),
        methods=_words(methods),
        best=QUICK_METHODS if quick else None,
        modes=_words(modes),
        dtypes=_words(dtypes),
        providers=_words(providers),
        threads=_numbers(threads, "--threads"),
        tiles_px=_numbers(tile, "--tile"),
        vary=not quick,
    )
    settings = Settings(
        bundles=tuple(dict.fromkeys(names)),
        references=tuple(reference or ()),
        axes=axes,
        repeat=(2 if quick else DEFAULT_REPEAT) if repeat is None else repeat,
        width_px=width,
        height_px=height,
        small=quick,
        capture=capture,
        photo=photo,
        data=data,
        images=images,
        saturate=saturate,
        constants={} if nits_per_unit is None else {"nits_per_unit": nits_per_unit},
        work_dir=work_dir,
        gemm_s=0.2 if quick else 1.0,
    )
    _run(settings, out_dir, as_json=json_)


def _cameras() -> list[str]:
    """Return the names of the built-in bundles that photograph and state a sensor's size."""
    from camkit.bundle.reader import built_in_bundles, open_bundle
    from camkit.report.bench.part import BenchPart
    from camkit.report.kind_finder import find_part

    manifests = {name: open_bundle(path).manifest for name, path in built_in_bundles().items()}
    return [
        name
        for name, manifest in manifests.items()
        if manifest.sensor.extent is not None
        and find_part(manifest.kind, "bench", BenchPart).measure is None
    ]


def _run(settings: "Settings", out_dir: Path, *, as_json: bool) -> None:
    from camkit.report.bench.output import write_bench
    from camkit.report.bench.own_rows import own_lines
    from camkit.report.bench.run import run_bench

    with working("preparing") as task:
        result = run_bench(settings, task.tell)
    files = write_bench(result, out_dir)
    if as_json:
        say(json.dumps(result.report, allow_nan=False))
        return
    rows = result.report["rows"]
    for line in own_lines(rows) if result.self_measured else _lines(rows):
        say(line)
    for skip in result.report["skipped"]:
        say(f"camkit: not measured: {skip['what']}: {skip['reason']}", err=True)
    say(f"written: {', '.join(str(file) for file in files)}")


def _lines(rows: "list[Row]") -> list[str]:
    columns = [
        *(("PSNR dB", "psnr_db", ".2f"), ("SSIM", "ssim", ".3f")),
        *(("HDR dB", "hdr_psnr_db", ".2f"), ("stops", "stops_rmse", ".2f")),
        *(("s", "seconds_median", ".2f"), ("p90", "seconds_p90", ".2f")),
        ("steady s", "steady_seconds_median", ".2f"),
    ]
    if not any("hdr_psnr_db" in row for row in rows):
        del columns[2:4]
    heads = ("bundle", "method", *(head for head, _, _ in columns), "peak MB", "noisy")
    table: list[tuple[str, ...]] = [heads]
    for row in rows:
        numbers = [
            "-" if row.get(key) is None else format(row[key], form) for _, key, form in columns
        ]
        peak = "-" if row["peak_rss_mb"] is None else f"{row['peak_rss_mb']:.0f}"
        noisy = {True: "yes", False: "no", None: "-"}[row["noisy"]]
        table.append((row["bundle"], row["label"], *numbers, peak, noisy))
        if row["error"]:
            table[-1] = (*table[-1][:2], f"failed: {row['error']}")
    widths = [
        max(len(line[i]) for line in table if len(line) == len(heads)) for i in range(len(heads))
    ]
    return ["  ".join(w.ljust(n) for w, n in zip(line, widths, strict=False)) for line in table]


def _words(text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    return tuple(dict.fromkeys(word.strip() for word in text.split(",") if word.strip())) or None


def _numbers(text: str | None, option: str) -> tuple[int, ...] | None:
    words = _words(text)
    if words is None:
        return None
    if not all(word.isdigit() for word in words):
        raise ContractError(f"{option} takes whole numbers with commas; got {text!r}")
    return tuple(int(word) for word in words)
