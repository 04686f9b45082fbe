"""`camkit analyse field`: light, detection and recovery over the field, of several lenses."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.judge.analyse.outputs import deliver
from camkit.cli.use.calibrate.calibration_outputs import Page, check_page
from camkit.errors import ContractError
from camkit.progress import working


def field(
    name: Annotated[
        str,
        typer.Argument(
            help="Bundle, lens (file or name), frozen optics (.safetensors) or pinhole "
            "(pinhole-0.8).",
            metavar="NAME",
        ),
    ],
    lens: Annotated[
        str | None,
        typer.Option(help="Further optics to compare, A,B; those without a sensor use NAME's."),
    ] = None,
    iso: Annotated[float, typer.Option(help="ISO speed of the captures.")] = 100.0,
    bars_px: Annotated[int, typer.Option(min=1, help="Width of the test bars in px.")] = 12,
    fields: Annotated[
        int, typer.Option(min=2, help="Number of field points from the axis to the corner.")
    ] = 9,
    wavelength_um: Annotated[
        float | None,
        typer.Option(
            help="Wavelength of the points in um; default: the middle colour of each sensor."
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder of sharp pictures to photograph and restore; default: no restoration."
        ),
    ] = None,
    pictures: Annotated[
        int | None, typer.Option(min=1, help="Number of these pictures; default: 1.")
    ] = None,
    frame: Annotated[
        str | None,
        typer.Option(help="Central WIDTHxHEIGHT of these frames in px; default: the whole frame."),
    ] = None,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Measure the image of a point over the field, and which detail is resolved and restored.

    Write lens:NAME for a lens whose name a bundle has too, PSF.safetensors+HAZE.safetensors for
    frozen optics with veiling glare. Lenses are traced, which needs torch.
    """
    check_page(page, overwrite=overwrite)
    frame_px = None if frame is None else _frame_px(frame)
    if pictures is not None and data is None:
        raise ContractError("pictures are those of a folder: give --data too, or no --pictures")
    from camkit.report.analysis.lens_field import FieldOptions, measure_field, to_json, to_text
    from camkit.report.analysis.subject import find_subject
    from camkit.report.quality import list_set, read_picture

    first = find_subject(name)
    names = [part.strip() for part in (lens or "").split(",") if part.strip()]
    if len({name, *names}) != 1 + len(names):
        raise ContractError(f"each lens is named once; got {', '.join((name, *names))}")
    subjects = [first, *(find_subject(other, first.sensor) for other in names)]
    options = FieldOptions(
        iso=iso,
        bars_px=bars_px,
        fields=fields,
        wavelength_um=wavelength_um,
        pictures=() if data is None else tuple(map(read_picture, list_set(data, pictures or 1))),
        frame_px=frame_px,
    )
    with working("measuring", len(subjects), unit="lenses") as task:
        measured = []
        for number, subject in enumerate(subjects):
            task.count(number)
            measured.append(measure_field(subject, options, task.tell))

    def html() -> str:
        from camkit.report.analysis.field_page import field_html

        return field_html(measured, options)

    deliver(to_json(measured, options), page, html, to_text, as_json=json_)


def _frame_px(text: str) -> tuple[int, int]:
    sides = text.lower().split("x")
    if len(sides) != 2 or not all(side.isdigit() for side in sides):
        raise ContractError(f"--frame takes WIDTHxHEIGHT in pixels; got {text!r}")
    # whole cells of a mosaic
    return int(sides[0]) // 2 * 2, int(sides[1]) // 2 * 2
