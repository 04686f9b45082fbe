"""`camkit analyse hallucination`: what restored pictures show that their captures do not hold."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.cli.use.calibrate.outputs import Page, check_page
from camkit.errors import ContractError

if TYPE_CHECKING:
    from camkit.report.analysis.hallucination import Options, Report


def hallucination(
    name: Annotated[str, typer.Argument(help="Bundle NAME or PATH.", metavar="NAME")],
    data: Annotated[Path, typer.Option(help="Folder of sharp pictures that no training saw.")],
    pictures: Annotated[int, typer.Option(min=1, help="How many of them.")] = 10,
    iso: Annotated[float, typer.Option(help="Sensitivity.")] = 100.0,
    sizes: Annotated[str | None, typer.Option(help="Sizes of the network, such as S,M.")] = None,
    patch_px: Annotated[int, typer.Option(help="Side of a patch.")] = 64,
    vgg: Annotated[
        Path | None,
        typer.Option(help="VGG-19 weights (.pth or .safetensors) for the perceptual measure."),
    ] = None,
    crops: Annotated[
        Path | None,
        typer.Option(help="Folder for the worst patches: truth, capture, result."),
    ] = None,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Judge restored pictures patch by patch, against the truth and against their captures.

    A control plants detail that no capture holds; the report says whether it was found.
    """
    check_page(page, overwrite=overwrite)
    if crops is not None and crops.exists() and not overwrite:
        raise ContractError(f"{crops} exists; say --overwrite or another name")
    from camkit.bundle.reader import find_bundle, open_bundle
    from camkit.report.analysis.hallucination import analyse, to_json, to_text
    from camkit.report.stress.scene import stress_scenes

    options = _options(iso, patch_px, sizes, vgg)
    bundle = open_bundle(find_bundle(name))
    report = analyse(bundle, stress_scenes(bundle, pictures, data), options, _tell)
    files = [] if crops is None else _write_crops(report, crops)
    told = to_json(report, files)
    if page is not None:
        from camkit.report.analysis.hallucination_page import hallucination_html
        from camkit.runtime.output.part_file import atomic_output

        page.parent.mkdir(parents=True, exist_ok=True)
        with atomic_output(page) as part:
            part.write_text(hallucination_html(report), encoding="utf-8")
        told["page"] = str(page)
    say(json.dumps(told, allow_nan=False) if json_ else to_text(told))


def _options(iso: float, patch_px: int, sizes: str | None, vgg: Path | None) -> "Options":
    from camkit.report.analysis.hallucination import Options
    from camkit.report.analysis.perceptual import VGG, vgg_measure

    options = Options(
        iso=iso,
        side_px=patch_px,
        sizes=() if sizes is None else tuple(size.strip() for size in sizes.split(",")),
    )
    if vgg is None:
        return options
    from dataclasses import replace

    from camkit.cli.design.design_time import require_torch

    require_torch("--vgg")
    return replace(options, perceptual=vgg_measure(vgg), perceptual_name=VGG)


def _write_crops(report: "Report", folder: Path) -> list[str]:
    from camkit.report.analysis.hallucination_page import crop_png

    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for number, crop in enumerate(report.method(report.control.method).worst, start=1):
        path = folder / f"worst-{number:02}.png"
        path.write_bytes(crop_png(crop))
        written.append(str(path))
    return written


def _tell(line: str) -> None:
    if sys.stderr.isatty():
        say(line, err=True)
