"""`camkit analyse hallucination`: what restored pictures show that their captures do not hold."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.judge.analyse.outputs import deliver
from camkit.cli.use.calibrate.calibration_outputs import Page, check_page
from camkit.errors import ContractError

if TYPE_CHECKING:
    from camkit.report.analysis.invented_detail import Options, Report


def hallucination(
    name: Annotated[str, typer.Argument(help="Camera bundle, NAME or PATH.", metavar="NAME")],
    data: Annotated[
        Path, typer.Option(help="Folder of sharp pictures that were not used in training.")
    ],
    pictures: Annotated[int, typer.Option(min=1, help="Number of pictures.")] = 10,
    iso: Annotated[float, typer.Option(help="ISO speed of the captures.")] = 100.0,
    sizes: Annotated[
        str | None, typer.Option(help="Network sizes, such as S,M; default: M.")
    ] = None,
    patch_px: Annotated[int, typer.Option(help="Side of a patch in px.")] = 64,
    vgg: Annotated[
        Path | None,
        typer.Option(
            help="VGG-19 weights (.pth or .safetensors) for the perceptual metric; default: "
            "gradients."
        ),
    ] = None,
    crops: Annotated[
        Path | None,
        typer.Option(help="Folder for the worst patches (truth, capture, result)."),
    ] = None,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Check restored pictures patch by patch, against the truth and against their captures.

    A control adds detail that no capture contains; the report states whether it was detected.
    """
    check_page(page, overwrite=overwrite)
    if crops is not None:
        _check_crops(crops, overwrite=overwrite)
    from camkit.bundle.reader import find_bundle, open_bundle
    from camkit.report.analysis.invented_detail import analyse, to_json, to_text
    from camkit.report.stress.scene import stress_scenes

    options = _options(iso, patch_px, sizes, vgg)
    bundle = open_bundle(find_bundle(name))
    report = analyse(bundle, stress_scenes(bundle, pictures, data), options)
    files = [] if crops is None else _write_crops(report, crops)

    def html() -> str:
        from camkit.report.analysis.hallucination_page import hallucination_html

        return hallucination_html(report)

    deliver(to_json(report, files), page, html, to_text, as_json=json_)


def _options(iso: float, patch_px: int, sizes: str | None, vgg: Path | None) -> "Options":
    from camkit.report.analysis.invented_detail import Options
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


def _check_crops(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder that is there and may not be filled anew, or is none.

    Raises:
        ContractError: If so.
    """
    if folder.exists() and not folder.is_dir():
        raise ContractError(f"--crops is a folder; {folder} is a file")
    if folder.exists() and not overwrite:
        raise ContractError(f"{folder} exists; add --overwrite or choose another name")


def _write_crops(report: "Report", folder: Path) -> list[str]:
    """Write the worst patches of the control's method; those of a run before go."""
    from camkit.report.analysis.hallucination_page import crop_png

    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("worst-[0-9][0-9].png"):
        old.unlink()
    written = []
    for number, crop in enumerate(report.method(report.control.method).worst, start=1):
        path = folder / f"worst-{number:02}.png"
        path.write_bytes(crop_png(crop))
        written.append(str(path))
    return written
